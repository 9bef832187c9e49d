#include <sqlite3ext.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "coordinator/query/drawn_campaign.hpp"
#include "coordinator/query/functions.hpp"
#include "coordinator/query/virtual_table-inl.hpp"
#include "core/campaign/model.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

enum Column : int { run_index_column, quantity_column, unit_column, value_column, campaign_column };

struct Draw {
  static constexpr const char* name = "draw";
  static constexpr const char* declaration =
      "CREATE TABLE draw(run_index INTEGER, quantity TEXT, unit TEXT, value REAL, "
      "campaign TEXT HIDDEN)";
  static constexpr const char* module = "proofmass_draw";
  static constexpr const char* creation =
      "CREATE VIRTUAL TABLE IF NOT EXISTS temp.draw USING proofmass_draw";

  using Made = DrawnCampaign;
  struct Cursor : sqlite3_vtab_cursor {
    std::shared_ptr<DrawnCampaign> runs;
    DrawScan scan;
    std::uint64_t run = 0;
    std::size_t quantity = 0;
    std::vector<double> values;  // Of the run; empty if all draws were rejected.
  };

  static int choose_plan(sqlite3_vtab* table, sqlite3_index_info* plan);
  static int filter(sqlite3_vtab_cursor* base, int plan, const char*, int, sqlite3_value** values);
  static int next(sqlite3_vtab_cursor* base);
  static int is_at_end(sqlite3_vtab_cursor* base);
  static int column(sqlite3_vtab_cursor* base, sqlite3_context* context, int number);
  static int row_identifier(sqlite3_vtab_cursor* base, sqlite3_int64* identifier);
};

using DrawTable = VirtualTable<Draw>;

Draw::Cursor& cursor_of(sqlite3_vtab_cursor* cursor) { return *static_cast<Draw::Cursor*>(cursor); }

/// What a plan may hand to the scan, in the order of its arguments; bit i of the plan's number says
/// that it does.
struct Offer {
  int column;
  unsigned char comparison;
  std::optional<RunComparison> run_comparison;
};

constexpr std::array<Offer, 7> offers{{
    {campaign_column, SQLITE_INDEX_CONSTRAINT_EQ, {}},
    {quantity_column, SQLITE_INDEX_CONSTRAINT_EQ, {}},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_EQ, RunComparison::equal},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GT, RunComparison::above},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GE, RunComparison::at_least},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LT, RunComparison::below},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LE, RunComparison::at_most},
}};
constexpr int campaign_bit = 1 << 0;
constexpr int quantity_bit = 1 << 1;
constexpr int run_bit = 1 << 2;
constexpr int range_bits = 0b1111 << 3;

// The place of the first usable constraint that fits an offer. Names are compared byte by byte, so
// that only such a comparison of quantities is one.
std::optional<int> constraint_for(const Offer& offer, sqlite3_index_info* plan) {
  for (int i = 0; i < plan->nConstraint; ++i) {
    const auto& constraint = plan->aConstraint[i];
    if (constraint.iColumn != offer.column || constraint.op != offer.comparison) continue;
    if (constraint.usable == 0) continue;
    const bool is_text = offer.column == quantity_column;
    if (is_text && std::string_view(sqlite3_vtab_collation(plan, i)) != "BINARY") continue;
    return i;
  }
  return std::nullopt;
}

// A campaign of medium size; a draw costs as much as a dozen rows.
void estimate_cost(sqlite3_index_info& plan) {
  const bool has_range = (plan.idxNum & range_bits) != 0;
  const double runs = (plan.idxNum & run_bit) != 0 ? 1.0 : has_range ? 1e3 : 1e5;
  const double rows =
      runs *
      ((plan.idxNum & quantity_bit) != 0 ? 1.0 : static_cast<double>(model().drawn().size()));
  plan.estimatedCost = 12.0 * runs + rows;
  plan.estimatedRows = static_cast<sqlite3_int64>(rows);
  constexpr int one_row = run_bit | quantity_bit;
  if ((plan.idxNum & one_row) == one_row) plan.idxFlags = SQLITE_INDEX_SCAN_UNIQUE;
}

int Draw::choose_plan(sqlite3_vtab*, sqlite3_index_info* plan) {
  if (ignores_the_argument(*plan, campaign_column)) return SQLITE_CONSTRAINT;
  int num_arguments = 0;
  for (std::size_t i = 0; i < offers.size(); ++i) {
    const std::optional<int> constraint = constraint_for(offers[i], plan);
    if (!constraint) continue;
    plan->idxNum |= 1 << i;
    plan->aConstraintUsage[*constraint].argvIndex = ++num_arguments;
    plan->aConstraintUsage[*constraint].omit = offers[i].column == campaign_column;
  }
  estimate_cost(*plan);
  plan->orderByConsumed = plan->nOrderBy == 1 && plan->aOrderBy[0].desc == 0 &&
                          plan->aOrderBy[0].iColumn == run_index_column;
  return SQLITE_OK;
}

// The database whose runs a plan asks for: the main one unless it names another.
std::string database_in(DrawTable& table, int plan, sqlite3_value** values) {
  return (plan & campaign_bit) == 0 ? "main" : database_of(table.connection, values[0]);
}

// Other types than these compare by rules of SQLite's own, and narrow nothing.
void narrow(DrawScan& scan, const Offer& offer, sqlite3_value* value) {
  const int type = sqlite3_value_type(value);
  if (type == SQLITE_NULL) return scan.leave_none();
  if (offer.run_comparison && type == SQLITE_INTEGER) {
    scan.narrow(*offer.run_comparison, std::int64_t{sqlite3_value_int64(value)});
  } else if (offer.run_comparison && type == SQLITE_FLOAT) {
    scan.narrow(*offer.run_comparison, sqlite3_value_double(value));
  } else if (!offer.run_comparison && type == SQLITE_TEXT) {
    const std::span<const DrawnQuantity> drawn = model().drawn();
    const auto found = std::ranges::find(drawn, text_of(value), &DrawnQuantity::name);
    if (found == drawn.end()) return scan.leave_none();
    scan.quantity = static_cast<std::size_t>(found - drawn.begin());
  }
}

// Behind the end there are no values.
void go_to_run(Draw::Cursor& cursor, std::uint64_t run) {
  cursor.run = run;
  cursor.quantity = cursor.scan.quantity.value_or(0);
  if (run < cursor.scan.end_run) cursor.values = cursor.runs->values_of(RunIndex{run});
}

int Draw::filter(sqlite3_vtab_cursor* base, int plan, const char*, int, sqlite3_value** values) {
  Cursor& cursor = cursor_of(base);
  return guarded(*base->pVtab, name, [&] {
    DrawTable& table = DrawTable::of(*base);
    cursor.runs =
        table.databases.current(table.connection, database_in(table, plan, values),
                                [](std::shared_ptr<const Campaign> campaign) {
                                  return std::make_shared<DrawnCampaign>(std::move(campaign));
                                });
    cursor.scan = {.first_run = 0, .end_run = cursor.runs->num_runs(), .quantity = {}};
    for (std::size_t i = 0; i < offers.size(); ++i) {
      if ((plan & (1 << i)) == 0) continue;
      sqlite3_value* value = *values++;
      if (offers[i].column != campaign_column) narrow(cursor.scan, offers[i], value);
    }
    go_to_run(cursor, cursor.scan.first_run);
  });
}

int Draw::next(sqlite3_vtab_cursor* base) {
  Cursor& cursor = cursor_of(base);
  return guarded(*base->pVtab, name, [&] {
    ++cursor.quantity;
    if (cursor.scan.quantity || cursor.quantity == model().drawn().size())
      go_to_run(cursor, cursor.run + 1);
  });
}

int Draw::is_at_end(sqlite3_vtab_cursor* cursor) {
  return cursor_of(cursor).run >= cursor_of(cursor).scan.end_run ? 1 : 0;
}

void set_text(sqlite3_context* context, std::string_view text) {
  sqlite3_result_text(context, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
}

int Draw::column(sqlite3_vtab_cursor* base, sqlite3_context* context, int number) {
  const Cursor& cursor = cursor_of(base);
  switch (number) {
    case run_index_column:
      sqlite3_result_int64(context, static_cast<sqlite3_int64>(cursor.run));
      break;
    case quantity_column:
      set_text(context, std::string(model().drawn()[cursor.quantity].name));
      break;
    case unit_column:
      set_text(context, std::string(model().drawn()[cursor.quantity].unit));
      break;
    case value_column:
      if (!cursor.values.empty()) {
        sqlite3_result_double(context, cursor.values[cursor.quantity]);
      }
      break;
    default:
      set_text(context, cursor.runs->campaign_name());
  }
  return SQLITE_OK;
}

int Draw::row_identifier(sqlite3_vtab_cursor* base, sqlite3_int64* identifier) {
  const Cursor& cursor = cursor_of(base);
  *identifier = static_cast<sqlite3_int64>(cursor.run * model().drawn().size() + cursor.quantity);
  return SQLITE_OK;
}

}  // namespace

int register_draw_table(sqlite3* connection) { return DrawTable::add_to(connection); }

}  // namespace proofmass::coordinator
