#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/campaign/campaign.hpp"

struct sqlite3;

namespace proofmass::coordinator {

/// The campaigns of the databases of a connection, read through that connection: a Store goes
/// through the SQLite of our own programs, and the extension must use the one that loads it. Each
/// is read when it is first needed and when its database has changed since.
class DatabaseCampaigns {
 public:
  /// Cursors own it too: each stays with what it began with.
  /// @param name  `main`, the name under which a database is attached, or the name of the campaign
  ///              in the main database; nothing: that one.
  /// @throws InvalidArgument if the name is none of these, or two of them; Error if the database
  ///         holds no campaign or a damaged one.
  [[nodiscard]] std::shared_ptr<const Campaign> current(sqlite3* connection,
                                                        const std::optional<std::string>& name);

 private:
  /// With counts of whatever may have changed the database, by this connection or by others.
  struct Known {
    std::int64_t data_version = 0;
    std::int64_t num_changes = 0;
    std::shared_ptr<const Campaign> campaign;
  };
  std::map<std::string, Known> databases_;
};

}  // namespace proofmass::coordinator
