#include "coordinator/query/definition_table.hpp"

#include <sqlite3ext.h>

#include <cstddef>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "coordinator/query/virtual_table.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

enum Column : int { key_column, value_column, campaign_column };

constexpr const char* table_name = "definition_entry";
// A value has the type that it has in the campaign file, hence none is declared.
constexpr const char* declaration =
    "CREATE TABLE definition_entry(key TEXT, value, campaign TEXT HIDDEN)";

struct Definition {
  std::string campaign;
  std::vector<DefinitionItem> items;
};

/// One for a connection.
struct DefinitionTable : sqlite3_vtab {
  sqlite3* connection = nullptr;
  MadeOfDatabases<Definition> databases;
};

/// One for a place in a statement that names the table.
struct DefinitionCursor : sqlite3_vtab_cursor {
  std::shared_ptr<Definition> definition;
  std::size_t position = 0;
};

DefinitionTable& table_of(sqlite3_vtab* table) { return *static_cast<DefinitionTable*>(table); }
DefinitionCursor& cursor_of(sqlite3_vtab_cursor* cursor) {
  return *static_cast<DefinitionCursor*>(cursor);
}

int connect(sqlite3* connection, void*, int, const char* const*, sqlite3_vtab** table, char**) {
  const int code = sqlite3_declare_vtab(connection, declaration);
  if (code != SQLITE_OK) return code;
  auto* made = new (std::nothrow) DefinitionTable();
  if (made == nullptr) return SQLITE_NOMEM;
  made->connection = connection;
  *table = made;
  return SQLITE_OK;
}

// Another function than connect(), for the reason that draw_table.cpp has: the table shall not be
// found as `other.definition_entry`.
int create(sqlite3* connection, void* nothing, int num_arguments, const char* const* arguments,
           sqlite3_vtab** table, char** error) {
  return connect(connection, nothing, num_arguments, arguments, table, error);
}

int disconnect(sqlite3_vtab* table) {
  delete &table_of(table);
  return SQLITE_OK;
}

// The number of the plan is that of the arguments which the scan gets: the campaign or none.
int choose_plan(sqlite3_vtab*, sqlite3_index_info* plan) {
  if (ignores_the_argument(*plan, campaign_column)) return SQLITE_CONSTRAINT;
  for (int i = 0; i < plan->nConstraint && plan->idxNum == 0; ++i) {
    const auto& constraint = plan->aConstraint[i];
    if (constraint.iColumn != campaign_column || constraint.usable == 0 ||
        constraint.op != SQLITE_INDEX_CONSTRAINT_EQ) {
      continue;
    }
    plan->idxNum = 1;
    plan->aConstraintUsage[i].argvIndex = 1;
    plan->aConstraintUsage[i].omit = 1;
  }
  constexpr int num_keys_expected = 500;
  plan->estimatedCost = num_keys_expected;
  plan->estimatedRows = num_keys_expected;
  return SQLITE_OK;
}

int open(sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
  return guarded(*table, table_name,
                 [&] { *cursor = std::make_unique<DefinitionCursor>().release(); });
}

int close(sqlite3_vtab_cursor* cursor) {
  delete &cursor_of(cursor);
  return SQLITE_OK;
}

int filter(sqlite3_vtab_cursor* base, int plan, const char*, int, sqlite3_value** values) {
  DefinitionCursor& cursor = cursor_of(base);
  return guarded(*base->pVtab, table_name, [&] {
    DefinitionTable& table = table_of(base->pVtab);
    const std::string database = plan == 0 ? "main" : database_of(table.connection, values[0]);
    cursor.definition = table.databases.current(
        table.connection, database, [](const std::shared_ptr<const Campaign>& campaign) {
          return std::make_shared<Definition>(
              Definition{.campaign = campaign->name, .items = campaign->items()});
        });
    cursor.position = 0;
  });
}

int next(sqlite3_vtab_cursor* base) {
  ++cursor_of(base).position;
  return SQLITE_OK;
}

int is_at_end(sqlite3_vtab_cursor* base) {
  const DefinitionCursor& cursor = cursor_of(base);
  return cursor.position >= cursor.definition->items.size() ? 1 : 0;
}

/// Gives SQLite a value with its own type.
struct SetValue {
  sqlite3_context* context;

  void operator()(std::int64_t number) const { sqlite3_result_int64(context, number); }
  void operator()(double number) const { sqlite3_result_double(context, number); }
  void operator()(const std::string& text) const {
    sqlite3_result_text(context, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }
};

int column(sqlite3_vtab_cursor* base, sqlite3_context* context, int number) {
  const DefinitionCursor& cursor = cursor_of(base);
  const DefinitionItem& item = cursor.definition->items[cursor.position];
  const SetValue set{context};
  switch (number) {
    case key_column:
      set(item.key);
      break;
    case value_column:
      std::visit(set, item.value);
      break;
    default:
      set(cursor.definition->campaign);
  }
  return SQLITE_OK;
}

int row_identifier(sqlite3_vtab_cursor* base, sqlite3_int64* identifier) {
  *identifier = static_cast<sqlite3_int64>(cursor_of(base).position);
  return SQLITE_OK;
}

constexpr sqlite3_module definition_module = [] {
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
}();

}  // namespace

int register_definition_table(sqlite3* connection) {
  const int code = sqlite3_create_module_v2(connection, "proofmass_definition", &definition_module,
                                            nullptr, nullptr);
  if (code != SQLITE_OK) return code;
  return sqlite3_exec(connection,
                      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.definition_entry "
                      "USING proofmass_definition",
                      nullptr, nullptr, nullptr);
}

}  // namespace proofmass::coordinator
