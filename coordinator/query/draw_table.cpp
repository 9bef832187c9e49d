#include <sqlite3ext.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/query/aggregates.hpp"
#include "coordinator/query/database_campaigns.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"

SQLITE_EXTENSION_INIT3

namespace proofmass::coordinator {
namespace {

std::string text_of(sqlite3_value* value) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(value));
  return text == nullptr ? std::string()
                         : std::string(text, static_cast<std::size_t>(sqlite3_value_bytes(value)));
}

/// What a plan may hand to the scan, in the order of its arguments; bit i of the plan's number says
/// that it does. The first is the argument of the table.
struct Offer {
  int column;
  unsigned char comparison = SQLITE_INDEX_CONSTRAINT_EQ;
  bool is_lower = false;  ///< It bounds the runs from below.
  bool is_upper = false;
  bool is_text = false;  ///< It names something, byte by byte.
};
constexpr int campaign_bit = 1 << 0;

// Takes the first usable constraint that fits an offer.
void take(const Offer& offer, int bit, sqlite3_index_info& plan) {
  for (int i = 0; i < plan.nConstraint; ++i) {
    const auto& constraint = plan.aConstraint[i];
    if (constraint.iColumn != offer.column || constraint.op != offer.comparison) continue;
    if (constraint.usable == 0) continue;
    if (offer.is_text && std::string_view(sqlite3_vtab_collation(&plan, i)) != "BINARY") continue;
    plan.idxNum |= bit;
    plan.aConstraintUsage[i].argvIndex = std::popcount(static_cast<unsigned>(plan.idxNum));
    plan.aConstraintUsage[i].omit = bit == campaign_bit ? 1 : 0;
    return;
  }
}

/// A table of one connection that is computed from the campaign of a database, as SQLite calls it.
/// A `Cursor` is a place in a statement that names the table. It is an sqlite3_vtab_cursor and has
///
///     name         of the table, for errors
///     module       its name for SQLite
///     declaration  the SQL of its columns
///     creation     the SQL that makes it, in the temporary database of a connection
///     argument     the number of the hidden column that holds the argument of the table: a name
///                  as of DatabaseCampaigns
///     campaign     which that means
///
///     static void choose_plan(sqlite3_index_info& plan)
///     void begin(bool is_other_campaign, int plan, sqlite3_value** arguments)
///     void next(), bool is_at_end() const, std::int64_t row() const
///     void give_column(sqlite3_context* context, int number) const
template <typename Cursor>
struct VirtualTable : sqlite3_vtab {
  sqlite3* connection = nullptr;
  DatabaseCampaigns campaigns;

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
  // No exception passes SQLite: its text becomes the error of the statement.
  template <typename Work>
  static int guarded(sqlite3_vtab& table, const Work& work) noexcept {
    try {
      work();
      return SQLITE_OK;
    } catch (const std::bad_alloc&) {
      return SQLITE_NOMEM;
    } catch (const std::exception& error) {
      sqlite3_free(table.zErrMsg);
      table.zErrMsg = sqlite3_mprintf("%s: %s", Cursor::name, error.what());
      return SQLITE_ERROR;
    }
  }

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

  // If a statement names a campaign in a way that the plan cannot use, the plan would ignore it.
  static int choose_plan(sqlite3_vtab*, sqlite3_index_info* plan) {
    const std::span constraints(plan->aConstraint, static_cast<std::size_t>(plan->nConstraint));
    const bool is_ignored = std::ranges::any_of(constraints, [&](const auto& constraint) {
      return constraint.iColumn == Cursor::argument &&
             constraint.op == SQLITE_INDEX_CONSTRAINT_EQ && constraint.usable == 0;
    });
    if (is_ignored) return SQLITE_CONSTRAINT;
    take({Cursor::argument}, campaign_bit, *plan);
    Cursor::choose_plan(*plan);
    return SQLITE_OK;
  }

  static int filter(sqlite3_vtab_cursor* cursor, int plan, const char*, int,
                    sqlite3_value** values) {
    auto& table = *static_cast<VirtualTable*>(cursor->pVtab);
    return guarded(table, [&] {
      std::optional<std::string> name;
      if ((plan & campaign_bit) != 0) {
        sqlite3_value* const argument = *values++;
        if (sqlite3_value_type(argument) != SQLITE_NULL) name = text_of(argument);
      }
      const auto meant = table.campaigns.current(table.connection, name);
      const bool is_other = std::exchange(of(cursor).campaign, meant) != meant;
      of(cursor).begin(is_other, plan, values);
    });
  }

  static Cursor& of(sqlite3_vtab_cursor* cursor) { return *static_cast<Cursor*>(cursor); }

  static constexpr sqlite3_module make_module() {
    sqlite3_module module{};
    module.xConnect = connect;
    // Another function than connect(): if both were the same, SQLite would take the table for one
    // that exists without having been created, and find it under the name of any database.
    // `other.draw` would then hold the runs of another campaign than the name says.
    module.xCreate = [](sqlite3* connection, void* nothing, int num_arguments,
                        const char* const* arguments, sqlite3_vtab** table, char** error) {
      return connect(connection, nothing, num_arguments, arguments, table, error);
    };
    module.xBestIndex = choose_plan;
    module.xDisconnect = module.xDestroy = [](sqlite3_vtab* table) {
      delete static_cast<VirtualTable*>(table);
      return SQLITE_OK;
    };
    module.xOpen = [](sqlite3_vtab* table, sqlite3_vtab_cursor** cursor) {
      return guarded(*table, [&] { *cursor = std::make_unique<Cursor>().release(); });
    };
    module.xClose = [](sqlite3_vtab_cursor* cursor) {
      delete &of(cursor);
      return SQLITE_OK;
    };
    module.xFilter = filter;
    module.xNext = [](sqlite3_vtab_cursor* cursor) {
      return guarded(*cursor->pVtab, [&] { of(cursor).next(); });
    };
    module.xEof = [](sqlite3_vtab_cursor* cursor) { return of(cursor).is_at_end() ? 1 : 0; };
    module.xColumn = [](sqlite3_vtab_cursor* cursor, sqlite3_context* context, int number) {
      return guarded(*cursor->pVtab, [&] { of(cursor).give_column(context, number); });
    };
    module.xRowid = [](sqlite3_vtab_cursor* cursor, sqlite3_int64* identifier) {
      *identifier = of(cursor).row();
      return SQLITE_OK;
    };
    return module;
  }
};

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
  static constexpr int argument = draw_campaign_column;

  static void choose_plan(sqlite3_index_info& plan);
  void begin(bool is_other_campaign, int plan, sqlite3_value** arguments);
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

constexpr std::array<Offer, 6> offers{{
    {.column = quantity_column, .is_text = true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_EQ, true, true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GT, true, false},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_GE, true, false},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LT, false, true},
    {run_index_column, SQLITE_INDEX_CONSTRAINT_LE, false, true},
}};
constexpr int bit_of(std::size_t offer) { return campaign_bit << (offer + 1); }
constexpr int quantity_bit = bit_of(0);
constexpr int run_bit = bit_of(1);
constexpr int range_bits = bit_of(2) | bit_of(3) | bit_of(4) | bit_of(5);

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
  for (std::size_t i = 0; i < offers.size(); ++i) take(offers[i], bit_of(i), plan);
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

void DrawCursor::begin(bool is_other_campaign, int plan, sqlite3_value** arguments) {
  if (is_other_campaign) last_run.reset();
  scan = {.first_run = 0, .end_run = campaign->num_runs, .quantity = {}};
  for (std::size_t i = 0; i < offers.size(); ++i) {
    if ((plan & bit_of(i)) != 0) narrow(scan, offers[i], drawn(), *arguments++);
  }
  if (drawn().empty()) scan.end_run = scan.first_run;
  go_to_run(scan.first_run);
}

void DrawCursor::next() {
  ++quantity;
  if (scan.quantity || quantity == drawn().size()) go_to_run(run + 1);
}

std::int64_t DrawCursor::row() const {
  return static_cast<std::int64_t>(run * drawn().size() + quantity);
}

// Gives SQLite a value with its own type.
void set(sqlite3_context* context, std::string_view text) {
  sqlite3_result_text(context, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
}
void set(sqlite3_context* context, std::int64_t number) { sqlite3_result_int64(context, number); }
void set(sqlite3_context* context, double number) { sqlite3_result_double(context, number); }

void DrawCursor::give_column(sqlite3_context* context, int number) const {
  switch (number) {
    case run_index_column:
      return set(context, static_cast<std::int64_t>(run));
    case quantity_column:
      return set(context, drawn()[quantity].name);
    case unit_column:
      return set(context, drawn()[quantity].unit);
    case draw_value_column:
      if (!values.empty()) set(context, values[quantity]);
      return;
    default:
      set(context, campaign->name);
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
  static constexpr int argument = entry_campaign_column;

  static void choose_plan(sqlite3_index_info& plan);
  void begin(bool is_other_campaign, int plan, sqlite3_value** arguments);
  void next() { ++position; }
  [[nodiscard]] bool is_at_end() const { return position >= items.size(); }
  [[nodiscard]] std::int64_t row() const { return static_cast<std::int64_t>(position); }
  void give_column(sqlite3_context* context, int number) const;

  std::shared_ptr<const Campaign> campaign;
  std::vector<DefinitionItem> items;  ///< Of the campaign.
  std::size_t position = 0;
};

void DefinitionCursor::choose_plan(sqlite3_index_info& plan) {
  constexpr int num_keys_expected = 500;
  plan.estimatedCost = num_keys_expected;
  plan.estimatedRows = num_keys_expected;
}

void DefinitionCursor::begin(bool is_other_campaign, int /*plan*/, sqlite3_value** /*arguments*/) {
  if (is_other_campaign) items = campaign->items();
  position = 0;
}

void DefinitionCursor::give_column(sqlite3_context* context, int number) const {
  const DefinitionItem& item = items[position];
  switch (number) {
    case key_column:
      return set(context, item.key);
    case entry_value_column:
      return std::visit([&](const auto& value) { set(context, value); }, item.value);
    default:
      set(context, campaign->name);
  }
}

}  // namespace

int register_tables(sqlite3* connection) {
  const int code = VirtualTable<DrawCursor>::add_to(connection);
  return code == SQLITE_OK ? VirtualTable<DefinitionCursor>::add_to(connection) : code;
}

}  // namespace proofmass::coordinator
