#include <sqlite3ext.h>

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "coordinator/query/functions.hpp"
#include "coordinator/query/virtual_table-inl.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

enum Column : int { key_column, value_column, campaign_column };

struct Definition {
  std::string campaign;
  std::vector<DefinitionItem> items;
};

struct DefinitionEntry {
  static constexpr const char* name = "definition_entry";
  // A value has the type that it has in the campaign file, hence none is declared.
  static constexpr const char* declaration =
      "CREATE TABLE definition_entry(key TEXT, value, campaign TEXT HIDDEN)";
  static constexpr const char* module = "proofmass_definition";
  static constexpr const char* creation =
      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.definition_entry USING proofmass_definition";

  using Made = Definition;
  struct Cursor : sqlite3_vtab_cursor {
    std::shared_ptr<Definition> definition;
    std::size_t position = 0;
  };

  static int choose_plan(sqlite3_vtab* table, sqlite3_index_info* plan);
  static int filter(sqlite3_vtab_cursor* base, int plan, const char*, int, sqlite3_value** values);
  static int next(sqlite3_vtab_cursor* base);
  static int is_at_end(sqlite3_vtab_cursor* base);
  static int column(sqlite3_vtab_cursor* base, sqlite3_context* context, int number);
  static int row_identifier(sqlite3_vtab_cursor* base, sqlite3_int64* identifier);
};

using DefinitionTable = VirtualTable<DefinitionEntry>;

DefinitionEntry::Cursor& cursor_of(sqlite3_vtab_cursor* cursor) {
  return *static_cast<DefinitionEntry::Cursor*>(cursor);
}

// The number of the plan is that of the arguments which the scan gets: the campaign or none.
int DefinitionEntry::choose_plan(sqlite3_vtab*, sqlite3_index_info* plan) {
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

int DefinitionEntry::filter(sqlite3_vtab_cursor* base, int plan, const char*, int,
                            sqlite3_value** values) {
  Cursor& cursor = cursor_of(base);
  return guarded(*base->pVtab, name, [&] {
    DefinitionTable& table = DefinitionTable::of(*base);
    const std::string database = plan == 0 ? "main" : database_of(table.connection, values[0]);
    cursor.definition = table.databases.current(
        table.connection, database, [](const std::shared_ptr<const Campaign>& campaign) {
          return std::make_shared<Definition>(
              Definition{.campaign = campaign->name, .items = campaign->items()});
        });
    cursor.position = 0;
  });
}

int DefinitionEntry::next(sqlite3_vtab_cursor* base) {
  ++cursor_of(base).position;
  return SQLITE_OK;
}

int DefinitionEntry::is_at_end(sqlite3_vtab_cursor* base) {
  const Cursor& cursor = cursor_of(base);
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

int DefinitionEntry::column(sqlite3_vtab_cursor* base, sqlite3_context* context, int number) {
  const Cursor& cursor = cursor_of(base);
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

int DefinitionEntry::row_identifier(sqlite3_vtab_cursor* base, sqlite3_int64* identifier) {
  *identifier = static_cast<sqlite3_int64>(cursor_of(base).position);
  return SQLITE_OK;
}

}  // namespace

int register_definition_table(sqlite3* connection) { return DefinitionTable::add_to(connection); }

}  // namespace proofmass::coordinator
