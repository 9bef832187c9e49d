#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "coordinator/query/drawn_campaign.hpp"

struct sqlite3_index_info;
struct sqlite3_value;
struct sqlite3_vtab;

namespace proofmass::coordinator {

// What the tables share that are computed from the campaign of a database: `draw` and
// `definition_entry`. Both take the name of a database or campaign as their argument.

/// SQLite's result code for the exception that is being handled; its text becomes the error of the
/// statement.
[[nodiscard]] int code_of_exception(sqlite3_vtab& table, const char* name) noexcept;

/// SQLite's result code of some work: no exception passes SQLite.
/// @param name  Of the table, for the error.
template <typename Work>
int guarded(sqlite3_vtab& table, const char* name, const Work& work) noexcept {
  try {
    work();
    return 0;  // SQLITE_OK.
  } catch (...) {
    return code_of_exception(table, name);
  }
}

[[nodiscard]] std::string text_of(sqlite3_value* value);

/// True if a statement names a campaign in a way that the plan cannot use: the plan would ignore
/// the name.
/// @param column  The hidden one that holds the argument of the table.
[[nodiscard]] bool ignores_the_argument(const sqlite3_index_info& plan, int column);

/// The database that an argument of a table means: the main one if it is NULL.
[[nodiscard]] std::string database_of(sqlite3* connection, sqlite3_value* argument);

/// Something that is made of the campaign of a database, for each database that was asked for. It
/// is made when it is first needed and when the database has changed since.
template <typename Made>
class MadeOfDatabases {
 public:
  /// @param make  Makes a shared pointer of a Campaign.
  template <typename Make>
  [[nodiscard]] std::shared_ptr<Made> current(sqlite3* connection, const std::string& database,
                                              const Make& make) {
    const DatabaseState state = state_of(connection, database);
    Known& known = databases_[database];
    if (!known.made || !(known.state == state)) {
      known.made = make(read_campaign_of(connection, database));
      known.state = state;
    }
    return known.made;
  }

 private:
  struct Known {
    DatabaseState state;         // When it was made.
    std::shared_ptr<Made> made;  // Cursors own it too: each stays with what it began with.
  };
  std::map<std::string, Known> databases_;
};

}  // namespace proofmass::coordinator
