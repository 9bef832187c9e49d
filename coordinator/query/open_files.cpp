#include "coordinator/query/open_files.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/store/store_error.hpp"

namespace proofmass::coordinator {
namespace {

void check(int code, sqlite3* connection, const std::filesystem::path& file) {
  if (code == SQLITE_OK) return;
  throw StoreError(
      fmt::format("campaign database = {} ({})", file.string(), sqlite3_errmsg(connection)));
}

Connection opened(const std::string& name, int flags, const std::filesystem::path& file) {
  sqlite3* connection = nullptr;
  const int code = sqlite3_open_v2(name.c_str(), &connection, flags | SQLITE_OPEN_URI, nullptr);
  Connection owned(connection);
  check(code, connection, file);
  return owned;
}

// The name of a file that SQLite may only read, whatever the connection may.
std::string read_only_uri(const std::filesystem::path& file) {
  std::string uri = "file:";
  for (const char character : std::filesystem::absolute(file).string()) {
    const bool is_special = character == '%' || character == '?' || character == '#';
    uri += is_special ? fmt::format("%{:02X}", static_cast<unsigned char>(character))
                      : std::string(1, character);
  }
  return uri + "?mode=ro";
}

void attach_database(sqlite3* connection, const std::string& database, const std::string& name,
                     const std::filesystem::path& file) {
  sqlite3_stmt* statement = nullptr;
  check(sqlite3_prepare_v2(connection, "ATTACH ? AS ?", -1, &statement, nullptr), connection, file);
  sqlite3_bind_text(statement, 1, database.c_str(), -1, SQLITE_TRANSIENT);
  sqlite3_bind_text(statement, 2, name.c_str(), -1, SQLITE_TRANSIENT);
  sqlite3_step(statement);
  check(sqlite3_finalize(statement), connection, file);
}

// Fills an empty database of the connection with a copy of the file that is up to date.
void copy_older(sqlite3* connection, const std::string& database,
                const std::filesystem::path& file) {
  const Connection source(detail::open_private_copy(file));
  sqlite3_backup* const backup =
      sqlite3_backup_init(connection, database.c_str(), source.get(), "main");
  if (backup == nullptr) check(sqlite3_errcode(connection), connection, file);
  (void)sqlite3_backup_step(backup, -1);
  check(sqlite3_backup_finish(backup), connection, file);
}

// Store knows a campaign database and says what is wrong with others.
bool is_older(const std::filesystem::path& file) {
  return Store::open_read_only(file).is_of_older_version();
}

// A database without a name is SQLite's own: in memory, or in a file that ends with the process. A
// connection that may only read cannot fill one; where one is needed, the files are read-only each
// by itself.
constexpr int may_fill_copies = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;

/// Which files are of an older version.
struct Older {
  bool is_main = false;
  std::vector<bool> attached;
  [[nodiscard]] bool has_attached() const {
    return std::ranges::find(attached, true) != attached.end();
  }
};

Connection open_main(const QueryFiles& files, const Older& older) {
  if (older.is_main) {
    if (files.attached.empty()) return Connection(detail::open_private_copy(files.main));
    Connection connection = opened("", may_fill_copies, files.main);
    copy_older(connection.get(), "main", files.main);
    return connection;
  }
  const int flags = older.has_attached() ? may_fill_copies : SQLITE_OPEN_READONLY;
  return opened(read_only_uri(files.main), flags, files.main);
}

}  // namespace

void CloseConnection::operator()(sqlite3* connection) const { sqlite3_close_v2(connection); }

void check_attached_name(std::string_view name) {
  const auto is_letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
  };
  const auto is_allowed = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9'); };
  const bool is_name = !name.empty() && name.size() <= 64 && is_letter(name[0]) &&
                       std::ranges::all_of(name, is_allowed);
  const std::string text(name);
  const bool is_taken =
      sqlite3_stricmp(text.c_str(), "main") == 0 || sqlite3_stricmp(text.c_str(), "temp") == 0;
  if (is_name && !is_taken) return;
  throw InvalidArgument(fmt::format(
      "name = {} (must be 1 to 64 letters, digits and _, not begin with a digit, and be neither "
      "main nor temp)",
      name));
}

Connection open_files(const QueryFiles& files) {
  PROOFMASS_EXPECT(files.attached.size() <= attached_files_max);
  Older older{.is_main = is_older(files.main), .attached = {}};
  for (const AttachedFile& other : files.attached) older.attached.push_back(is_older(other.file));
  Connection connection = open_main(files, older);
  for (std::size_t i = 0; i < files.attached.size(); ++i) {
    const auto& [name, file] = files.attached[i];
    attach_database(connection.get(), older.attached[i] ? "" : read_only_uri(file), name, file);
    if (older.attached[i]) copy_older(connection.get(), name, file);
  }
  return connection;
}

}  // namespace proofmass::coordinator
