#include "coordinator/store/detail/private_copy.hpp"

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"

namespace proofmass::coordinator::detail {

sqlite3* open_private_copy(const std::filesystem::path& file) {
  Database database(file, Access::read_only);
  configure(database);
  check_campaign_file(database, file);
  migrate_privately(database);
  return database.release();
}

}  // namespace proofmass::coordinator::detail
