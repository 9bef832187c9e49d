#include <sqlite3ext.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/query/aggregates.hpp"
#include "coordinator/query/virtual_table-inl.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

enum DrawColumn : int {
  run_index_column,
  quantity_column,
  unit_column,
  draw_value_column,
  draw_campaign_column
};

/// The rows of draw() that a statement wants: at least those, as SQLite looks at each row again.
struct DrawScan {
  std::uint64_t first_run = 0;
  std::uint64_t end_run = 0;            ///< One behind the last.
  std::optional<std::size_t> quantity;  ///< Index into Model::drawn(); empty for all.
};

struct DrawCursor : sqlite3_vtab_cursor {
  static constexpr const char* name = "draw";
  static constexpr const char* module = "proofmass_draw";
  static constexpr const char* declaration =
      "CREATE TABLE draw(run_index INTEGER, quantity TEXT, unit TEXT, value REAL, "
      "campaign TEXT HIDDEN)";
  static constexpr const char* creation =
      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.draw USING proofmass_draw";
  static constexpr int argument_column = draw_campaign_column;

  static void choose_plan(sqlite3_index_info& plan);
  void begin(VirtualTable<DrawCursor>& table, int plan, sqlite3_value** arguments);
  void next();
  [[nodiscard]] bool is_at_end() const { return run >= scan.end_run; }
  [[nodiscard]] std::int64_t row() const;
  void give_column(sqlite3_context* context, int number) const;

  void go_to_run(std::uint64_t index);
  [[nodiscard]] std::span<const DrawnQuantity> drawn() const { return campaign->model().drawn(); }

  std::shared_ptr<const Campaign> campaign;
  DrawScan scan;
  std::uint64_t run = 0;
  std::size_t quantity = 0;
  /// Of the run whose values follow: a join asks for the quantities of a run one by one.
  std::optional<RunIndex> last_run;
  std::vector<double> values;  ///< Those its simulation begins with; empty without a draw.
};

/// What a plan may hand to the scan, in the order of its arguments; bit i of the plan's number says
/// that it does.
struct Offer {
  int column;
  unsigned char comparison;
  bool is_lower = false;  ///< It bounds the runs from below.
  bool is_upper = false;
  bool is_text = false;  ///< It names something, byte by byte.
};

constexpr std::array<Offer, 7> offers{{
    {draw_campaign_column, SQLITE_INDEX_CONSTRAINT_EQ},
    {.column = quantity_column, .comparison = SQLITE_INDEX_CONSTRAINT_EQ, .is_text = true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_EQ, true, true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GT, true, false},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GE, true, false},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LT, false, true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LE, false, true},
}};
constexpr int campaign_bit = 1 << 0;
constexpr int quantity_bit = 1 << 1;
constexpr int run_bit = 1 << 2;
constexpr int range_bits = 0b1111 << 3;

// The place of the first usable constraint that fits an offer.
std::optional<int> constraint_for(const Offer& offer, sqlite3_index_info& plan) {
  for (int i = 0; i < plan.nConstraint; ++i) {
    const auto& constraint = plan.aConstraint[i];
    if (constraint.iColumn != offer.column || constraint.op != offer.comparison) continue;
    if (constraint.usable == 0) continue;
    if (offer.is_text && std::string_view(sqlite3_vtab_collation(&plan, i)) != "BINARY") continue;
    return i;
  }
  return std::nullopt;
}

// A campaign of medium size; a draw costs as much as a dozen rows.
void estimate_cost(sqlite3_index_info& plan) {
  constexpr double num_drawn = 50.0;
  const bool has_range = (plan.idxNum & range_bits) != 0;
  const double runs = (plan.idxNum & run_bit) != 0 ? 1.0 : has_range ? 1e3 : 1e5;
  const double rows = runs * ((plan.idxNum & quantity_bit) != 0 ? 1.0 : num_drawn);
  plan.estimatedCost = 12.0 * runs + rows;
  plan.estimatedRows = static_cast<sqlite3_int64>(rows);
  constexpr int one_row = run_bit | quantity_bit;
  if ((plan.idxNum & one_row) == one_row) plan.idxFlags = SQLITE_INDEX_SCAN_UNIQUE;
}

void DrawCursor::choose_plan(sqlite3_index_info& plan) {
  int num_arguments = 0;
  for (std::size_t i = 0; i < offers.size(); ++i) {
    const std::optional<int> constraint = constraint_for(offers[i], plan);
    if (!constraint) continue;
    plan.idxNum |= 1 << i;
    plan.aConstraintUsage[*constraint].argvIndex = ++num_arguments;
    plan.aConstraintUsage[*constraint].omit = offers[i].column == draw_campaign_column;
  }
  estimate_cost(plan);
  plan.orderByConsumed = plan.nOrderBy == 1 && plan.aOrderBy[0].desc == 0 &&
                         plan.aOrderBy[0].iColumn == run_index_column;
}

// Other types than these compare by rules of SQLite's own, and narrow nothing.
void narrow(DrawScan& scan, const Offer& offer, std::span<const DrawnQuantity> drawn,
            sqlite3_value* value) {
  const int type = sqlite3_value_type(value);
  if (type == SQLITE_NULL) {
    scan.end_run = scan.first_run;
  } else if (offer.column == quantity_column && type == SQLITE_TEXT) {
    const auto found = std::ranges::find(drawn, text_of(value), &DrawnQuantity::name);
    if (found == drawn.end()) {
      scan.end_run = scan.first_run;
    } else {
      scan.quantity = static_cast<std::size_t>(found - drawn.begin());
    }
  } else if (offer.column == run_index_column && type != SQLITE_TEXT && type != SQLITE_BLOB) {
    // One step outside all run indices excludes or admits as much as any further one.
    const double bound =
        std::clamp(sqlite3_value_double(value), -1.0, static_cast<double>(num_runs_max));
    const auto end = static_cast<std::uint64_t>(std::floor(bound) + 1.0);
    if (offer.is_lower)
      scan.first_run = std::max(scan.first_run, end - std::min<std::uint64_t>(end, 1));
    if (offer.is_upper) scan.end_run = std::min(scan.end_run, end);
  }
}

// Behind the end there are no values.
void DrawCursor::go_to_run(std::uint64_t index) {
  run = index;
  quantity = scan.quantity.value_or(0);
  if (run >= scan.end_run || last_run == RunIndex{run}) return;
  values = campaign->draw(RunIndex{run}).values;
  last_run = RunIndex{run};
}

// Without an argument, the main database is meant.
void DrawCursor::begin(VirtualTable<DrawCursor>& table, int plan, sqlite3_value** arguments) {
  const bool is_named = (plan & campaign_bit) != 0;
  const auto meant = table.campaigns.current(
      table.connection, is_named ? database_of(table.connection, arguments[0]) : "main");
  if (std::exchange(campaign, meant) != meant) last_run.reset();
  scan = {.first_run = 0, .end_run = campaign->num_runs, .quantity = {}};
  for (std::size_t i = 0; i < offers.size(); ++i) {
    if ((plan & (1 << i)) == 0) continue;
    sqlite3_value* value = *arguments++;
    if (offers[i].column != draw_campaign_column) {
      narrow(scan, offers[i], drawn(), value);
    }
  }
  go_to_run(scan.first_run);
}

void DrawCursor::next() {
  ++quantity;
  if (scan.quantity || quantity == drawn().size()) go_to_run(run + 1);
}

std::int64_t DrawCursor::row() const {
  return static_cast<std::int64_t>(run * drawn().size() + quantity);
}

void set_text(sqlite3_context* context, std::string_view text) {
  sqlite3_result_text(context, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
}

void DrawCursor::give_column(sqlite3_context* context, int number) const {
  switch (number) {
    case run_index_column:
      return sqlite3_result_int64(context, static_cast<sqlite3_int64>(run));
    case quantity_column:
      return set_text(context, drawn()[quantity].name);
    case unit_column:
      return set_text(context, drawn()[quantity].unit);
    case draw_value_column:
      if (!values.empty()) sqlite3_result_double(context, values[quantity]);
      return;
    default:
      set_text(context, campaign->name);
  }
}

enum EntryColumn : int { key_column, entry_value_column, entry_campaign_column };

struct DefinitionCursor : sqlite3_vtab_cursor {
  static constexpr const char* name = "definition_entry";
  static constexpr const char* module = "proofmass_definition";
  // A value has the type that it has in the campaign file, hence none is declared.
  static constexpr const char* declaration =
      "CREATE TABLE definition_entry(key TEXT, value, campaign TEXT HIDDEN)";
  static constexpr const char* creation =
      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.definition_entry USING proofmass_definition";
  static constexpr int argument_column = entry_campaign_column;

  static void choose_plan(sqlite3_index_info& plan);
  void begin(VirtualTable<DefinitionCursor>& table, int plan, sqlite3_value** arguments);
  void next() { ++position; }
  [[nodiscard]] bool is_at_end() const { return position >= items.size(); }
  [[nodiscard]] std::int64_t row() const { return static_cast<std::int64_t>(position); }
  void give_column(sqlite3_context* context, int number) const;

  std::shared_ptr<const Campaign> campaign;
  std::vector<DefinitionItem> items;  ///< Of the campaign.
  std::size_t position = 0;
};

// The number of the plan is that of the arguments which the scan gets: the campaign or none.
void DefinitionCursor::choose_plan(sqlite3_index_info& plan) {
  if (const auto i = constraint_for({entry_campaign_column, SQLITE_INDEX_CONSTRAINT_EQ}, plan)) {
    plan.idxNum = 1;
    plan.aConstraintUsage[*i].argvIndex = 1;
    plan.aConstraintUsage[*i].omit = 1;
  }
  constexpr int num_keys_expected = 500;
  plan.estimatedCost = num_keys_expected;
  plan.estimatedRows = num_keys_expected;
}

void DefinitionCursor::begin(VirtualTable<DefinitionCursor>& table, int plan,
                             sqlite3_value** arguments) {
  const std::string database = plan == 0 ? "main" : database_of(table.connection, arguments[0]);
  const auto meant = table.campaigns.current(table.connection, database);
  if (std::exchange(campaign, meant) != meant) items = campaign->items();
  position = 0;
}

/// Gives SQLite a value with its own type.
struct SetValue {
  sqlite3_context* context;

  void operator()(std::int64_t number) const { sqlite3_result_int64(context, number); }
  void operator()(double number) const { sqlite3_result_double(context, number); }
  void operator()(const std::string& text) const { set_text(context, text); }
};

void DefinitionCursor::give_column(sqlite3_context* context, int number) const {
  const DefinitionItem& item = items[position];
  const SetValue set{context};
  switch (number) {
    case key_column:
      return set(item.key);
    case entry_value_column:
      return std::visit(set, item.value);
    default:
      set(campaign->name);
  }
}

}  // namespace

int register_tables(sqlite3* connection) {
  const int code = VirtualTable<DrawCursor>::add_to(connection);
  return code == SQLITE_OK ? VirtualTable<DefinitionCursor>::add_to(connection) : code;
}

}  // namespace proofmass::coordinator
