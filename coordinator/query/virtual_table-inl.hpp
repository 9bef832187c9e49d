#pragma once

#include <sqlite3ext.h>

#include <cstdint>
#include <map>
#include <memory>
#include <new>
#include <string>

#include "core/campaign/campaign.hpp"

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

/// The campaign that a database of a connection holds, read through that connection. Unlike
/// stored_campaign(), this goes through the SQLite of the program that loads the extension.
/// @param database  `main`, or the name under which it is attached.
/// @throws Error if it holds none or a damaged one.
[[nodiscard]] std::shared_ptr<const Campaign> read_campaign_of(sqlite3* connection,
                                                               const std::string& database);

/// The database of a connection that a query means by an argument of a table.
/// @param argument  `main`, the name under which a database is attached, or the name of the
///                  campaign in the main database.
/// @throws InvalidArgument if it is none of these, or two of them.
[[nodiscard]] std::string database_meant_by(sqlite3* connection, const std::string& argument);

/// Counts whatever may have changed the database, by this connection or by others.
struct DatabaseState {
  std::int64_t data_version = 0;
  std::int64_t num_changes = 0;

  bool operator==(const DatabaseState&) const = default;
};

/// @throws Error if the database cannot be read.
[[nodiscard]] DatabaseState state_of(sqlite3* connection, const std::string& database);

/// The campaigns of the databases that were asked for. Each is read when it is first needed and
/// when its database has changed since.
class CampaignsOfDatabases {
 public:
  /// Cursors own it too: each stays with what it began with.
  [[nodiscard]] std::shared_ptr<const Campaign> current(sqlite3* connection,
                                                        const std::string& database) {
    const DatabaseState state = state_of(connection, database);
    Known& known = databases_[database];
    if (!known.campaign || !(known.state == state)) {
      known = {.state = state, .campaign = read_campaign_of(connection, database)};
    }
    return known.campaign;
  }

 private:
  struct Known {
    DatabaseState state;  // When it was read.
    std::shared_ptr<const Campaign> campaign;
  };
  std::map<std::string, Known> databases_;
};

/// A table of one connection, as SQLite calls it. A `Cursor` is a place in a statement that names
/// the table. It is an sqlite3_vtab_cursor and has
///
///     name         of the table, for errors
///     module       its name for SQLite
///     declaration  the SQL of its columns
///     creation     the SQL that makes it, in the temporary database of a connection
///
///     static void choose_plan(sqlite3_index_info& plan)
///     void begin(VirtualTable<Cursor>& table, int plan, sqlite3_value** values)
///     void next(), bool is_at_end() const, std::int64_t row() const
///     void give_column(sqlite3_context* context, int number) const
///
/// and `argument_column`, the number of the hidden column that holds the argument of the table.
template <typename Cursor>
struct VirtualTable : sqlite3_vtab {
  sqlite3* connection = nullptr;
  CampaignsOfDatabases campaigns;

  /// Makes the table known to a connection.
  /// @returns SQLite's result code.
  static int add_to(sqlite3* connection) {
    static constexpr sqlite3_module module = make_module();
    const int code =
        sqlite3_create_module_v2(connection, Cursor::module, &module, nullptr, nullptr);
    if (code != SQLITE_OK) return code;
    return sqlite3_exec(connection, Cursor::creation, nullptr, nullptr, nullptr);
  }

 private:
  static int connect(sqlite3* connection, void*, int, const char* const*, sqlite3_vtab** table,
                     char**) {
    const int code = sqlite3_declare_vtab(connection, Cursor::declaration);
    if (code != SQLITE_OK) return code;
    auto* made = new (std::nothrow) VirtualTable();
    if (made == nullptr) return SQLITE_NOMEM;
    made->connection = connection;
    *table = made;
    return SQLITE_OK;
  }

  // Another function than connect(): if both were the same, SQLite would take the table for one
  // that exists without having been created, and find it under the name of any database.
  // `other.draw` would then hold the runs of another campaign than the name says.
  static int create(sqlite3* connection, void* nothing, int num_arguments,
                    const char* const* arguments, sqlite3_vtab** table, char** error) {
    return connect(connection, nothing, num_arguments, arguments, table, error);
  }

  static int disconnect(sqlite3_vtab* table) {
    delete static_cast<VirtualTable*>(table);
    return SQLITE_OK;
  }

  static int choose_plan(sqlite3_vtab*, sqlite3_index_info* plan) {
    if (ignores_the_argument(*plan, Cursor::argument_column)) return SQLITE_CONSTRAINT;
    Cursor::choose_plan(*plan);
    return SQLITE_OK;
  }

  static int open(sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
    return guarded(*table, Cursor::name, [&] { *cursor = std::make_unique<Cursor>().release(); });
  }

  static int close(sqlite3_vtab_cursor* cursor) {
    delete &of(cursor);
    return SQLITE_OK;
  }

  static int filter(sqlite3_vtab_cursor* cursor, int plan, const char*, int,
                    sqlite3_value** values) {
    auto& table = *static_cast<VirtualTable*>(cursor->pVtab);
    return guarded(table, Cursor::name, [&] { of(cursor).begin(table, plan, values); });
  }

  static int next(sqlite3_vtab_cursor* cursor) {
    return guarded(*cursor->pVtab, Cursor::name, [&] { of(cursor).next(); });
  }

  static int is_at_end(sqlite3_vtab_cursor* cursor) { return of(cursor).is_at_end() ? 1 : 0; }

  static int column(sqlite3_vtab_cursor* cursor, sqlite3_context* context, int number) {
    return guarded(*cursor->pVtab, Cursor::name, [&] { of(cursor).give_column(context, number); });
  }

  static int row_identifier(sqlite3_vtab_cursor* cursor, sqlite3_int64* identifier) {
    *identifier = of(cursor).row();
    return SQLITE_OK;
  }

  static Cursor& of(sqlite3_vtab_cursor* cursor) { return *static_cast<Cursor*>(cursor); }

  static constexpr sqlite3_module make_module() {
    sqlite3_module module{};
    module.xCreate = create;
    module.xConnect = connect;
    module.xBestIndex = choose_plan;
    module.xDisconnect = disconnect;
    module.xDestroy = disconnect;
    module.xOpen = open;
    module.xClose = close;
    module.xFilter = filter;
    module.xNext = next;
    module.xEof = is_at_end;
    module.xColumn = column;
    module.xRowid = row_identifier;
    return module;
  }
};

}  // namespace proofmass::coordinator
