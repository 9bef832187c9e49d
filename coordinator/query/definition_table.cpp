#include <sqlite3ext.h>

#include <cstddef>
#include <cstdint>
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

enum EntryColumn : int { key_column, entry_value_column, entry_campaign_column };

struct Definition {
  std::string campaign;
  std::vector<DefinitionItem> items;
};

struct DefinitionCursor : sqlite3_vtab_cursor {
  static constexpr const char* name = "definition_entry";
  static constexpr const char* module = "proofmass_definition";
  // A value has the type that it has in the campaign file, hence none is declared.
  static constexpr const char* declaration =
      "CREATE TABLE definition_entry(key TEXT, value, campaign TEXT HIDDEN)";
  static constexpr const char* creation =
      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.definition_entry USING proofmass_definition";
  static constexpr int argument_column = entry_campaign_column;
  using Made = Definition;

  static void choose_plan(sqlite3_index_info& plan);
  void begin(VirtualTable<DefinitionCursor>& table, int plan, sqlite3_value** arguments);
  void next() { ++position; }
  [[nodiscard]] bool is_at_end() const { return position >= definition->items.size(); }
  [[nodiscard]] std::int64_t row() const { return static_cast<std::int64_t>(position); }
  void give_column(sqlite3_context* context, int number) const;

  std::shared_ptr<Definition> definition;
  std::size_t position = 0;
};

// The number of the plan is that of the arguments which the scan gets: the campaign or none.
void DefinitionCursor::choose_plan(sqlite3_index_info& plan) {
  for (int i = 0; i < plan.nConstraint && plan.idxNum == 0; ++i) {
    const auto& constraint = plan.aConstraint[i];
    if (constraint.iColumn != entry_campaign_column || constraint.usable == 0 ||
        constraint.op != SQLITE_INDEX_CONSTRAINT_EQ) {
      continue;
    }
    plan.idxNum = 1;
    plan.aConstraintUsage[i].argvIndex = 1;
    plan.aConstraintUsage[i].omit = 1;
  }
  constexpr int num_keys_expected = 500;
  plan.estimatedCost = num_keys_expected;
  plan.estimatedRows = num_keys_expected;
}

void DefinitionCursor::begin(VirtualTable<DefinitionCursor>& table, int plan,
                             sqlite3_value** arguments) {
  const std::string database = plan == 0 ? "main" : database_of(table.connection, arguments[0]);
  definition = table.databases.current(
      table.connection, database, [](const std::shared_ptr<const Campaign>& campaign) {
        return std::make_shared<Definition>(
            Definition{.campaign = campaign->name, .items = campaign->items()});
      });
  position = 0;
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

void DefinitionCursor::give_column(sqlite3_context* context, int number) const {
  const DefinitionItem& item = definition->items[position];
  const SetValue set{context};
  switch (number) {
    case key_column:
      return set(item.key);
    case entry_value_column:
      return std::visit(set, item.value);
    default:
      set(definition->campaign);
  }
}

}  // namespace

int register_definition_table(sqlite3* connection) {
  return VirtualTable<DefinitionCursor>::add_to(connection);
}

}  // namespace proofmass::coordinator
