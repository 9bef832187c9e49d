#pragma once

#include <sqlite3ext.h>

#include <map>
#include <memory>
#include <new>
#include <string>
#include <utility>

#include "coordinator/query/drawn_campaign.hpp"

SQLITE_EXTENSION_INIT3

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

/// A table of one connection, as SQLite calls it. Its `Kind` has
///
///     name         of the table, for errors
///     module       its name for SQLite
///     declaration  the SQL of its columns
///     creation     the SQL that makes it, in the temporary database of a connection
///     Made         what is made of the campaign of a database
///     Cursor       a place in a statement that names the table; an sqlite3_vtab_cursor
///
/// and the functions choose_plan, filter, next, is_at_end, column and row_identifier, which SQLite
/// calls xBestIndex, xFilter, xNext, xEof, xColumn and xRowid.
template <typename Kind>
struct VirtualTable : sqlite3_vtab {
  sqlite3* connection = nullptr;
  MadeOfDatabases<typename Kind::Made> databases;

  static VirtualTable& of(sqlite3_vtab_cursor& cursor) {
    return *static_cast<VirtualTable*>(cursor.pVtab);
  }

  /// Makes the table known to a connection.
  /// @returns SQLite's result code.
  static int add_to(sqlite3* connection) {
    static constexpr sqlite3_module module = make_module();
    const int code = sqlite3_create_module_v2(connection, Kind::module, &module, nullptr, nullptr);
    if (code != SQLITE_OK) return code;
    return sqlite3_exec(connection, Kind::creation, nullptr, nullptr, nullptr);
  }

 private:
  static int connect(sqlite3* connection, void*, int, const char* const*, sqlite3_vtab** table,
                     char**) {
    const int code = sqlite3_declare_vtab(connection, Kind::declaration);
    if (code != SQLITE_OK) return code;
    auto* made = new (std::nothrow) VirtualTable();
    if (made == nullptr) return SQLITE_NOMEM;
    made->connection = connection;
    *table = made;
    return SQLITE_OK;
  }

  // Another function than connect(), as SQLite takes a table whose functions are the same for one
  // that is there without having been created: it would then be found by the name of any database,
  // also `other.draw`, and hold the runs of another campaign than the name says.
  static int create(sqlite3* connection, void* nothing, int num_arguments,
                    const char* const* arguments, sqlite3_vtab** table, char** error) {
    return connect(connection, nothing, num_arguments, arguments, table, error);
  }

  static int disconnect(sqlite3_vtab* table) {
    delete static_cast<VirtualTable*>(table);
    return SQLITE_OK;
  }

  static int open(sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
    return guarded(*table, Kind::name,
                   [&] { *cursor = std::make_unique<typename Kind::Cursor>().release(); });
  }

  static int close(sqlite3_vtab_cursor* cursor) {
    delete static_cast<typename Kind::Cursor*>(cursor);
    return SQLITE_OK;
  }

  static constexpr sqlite3_module make_module() {
    sqlite3_module module{};
    module.xCreate = create;
    module.xConnect = connect;
    module.xBestIndex = Kind::choose_plan;
    module.xDisconnect = disconnect;
    module.xDestroy = disconnect;
    module.xOpen = open;
    module.xClose = close;
    module.xFilter = Kind::filter;
    module.xNext = Kind::next;
    module.xEof = Kind::is_at_end;
    module.xColumn = Kind::column;
    module.xRowid = Kind::row_identifier;
    return module;
  }
};

}  // namespace proofmass::coordinator
