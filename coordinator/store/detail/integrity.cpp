#include "coordinator/store/detail/integrity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/store/detail/entry_rows.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/sha256.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator::detail {
namespace {

// How the campaign is served is left out: it changes while a coordinator has the file.
void add_campaign(const Database& database, Sha256& hash) {
  Statement row = database.prepare(
      "SELECT name, seed, num_runs, definition, model_version, build, created_utc, campaign_uid,"
      " owner, stop_rule, num_runs_max, failures_max, num_runs_fixed FROM campaign");
  if (!row.step()) database.refuse_as_damaged("it has no campaign");
  const int num_columns = row.num_columns();
  for (int column = 0; column < num_columns - 1; ++column) hash.add(row.shown(column));
  if (row.optional_count(num_columns - 1)) hash.add(row.shown(num_columns - 1));
}

void add_data_tables(const Database& database, Sha256& hash) {
  for (const DataTableSchema& table : model().results().tables) {
    hash.add(database.count(fmt::format("SELECT count(*) FROM {}", table.table)));
    Statement row = database.prepare(fmt::format("SELECT position, {} FROM {} ORDER BY position",
                                                 fmt::join(table.columns, ", "), table.table));
    while (row.step()) {
      hash.add(row.count(0));
      for (int column = 1; column < row.num_columns(); ++column) hash.add(row.real(column));
    }
  }
}

void add_dispersions(const Database& database, Sha256& hash) {
  hash.add(database.count("SELECT count(*) FROM dispersion_value"));
  Statement row = database.prepare(
      "SELECT quantity, run_index, value FROM dispersion_value ORDER BY quantity, run_index");
  while (row.step()) {
    hash.add(row.text(0));
    hash.add(row.count(1));
    hash.add(row.real(2));
  }
}

void check_references(const Database& database) {
  Statement select = database.prepare("PRAGMA foreign_key_check");
  if (!select.step()) return;
  database.refuse(
      fmt::format("is damaged: row {} of {} refers to no row of {}; restore it from a "
                  "copy",
                  select.integer(1), select.text(0), select.text(2)));
}

// Tables of one row; SQLite's own check lets the conditions of their keys be.
void check_single_rows(const Database& database) {
  for (const std::string_view key : {"campaign_id FROM campaign", "summary_id FROM summary"}) {
    Statement select = database.prepare(fmt::format("SELECT {}", key));
    for (std::int64_t must = 1; select.step(); ++must) {
      if (must == 1 && select.integer(0) == must) continue;
      database.refuse_as_damaged(
          fmt::format("{} = {} (must be 1)", select.column_name(0), select.integer(0)));
    }
  }
}

/// Whether the next row has this run and number.
bool has_row(Statement& select, RunIndex run, std::uint64_t number) {
  return select.step() && select.count(0) == run.value && select.count(1) == number;
}

// `overrun` and `worst_run` follow from the results.
void check_largest_errors(const Database& database) {
  const std::vector<double> objectives = read_objectives(database);
  const std::vector<Quantity>& quantities = model().results().quantities;
  WorstRunTable worst(quantities.size());
  Statement overrun =
      database.prepare("SELECT run_index, parameters FROM overrun ORDER BY run_index");
  Statement row = select_results(database);
  while (row.step()) {
    const RunResult result = read_result(row);
    const std::uint64_t exceeded = exceeded_objectives(result, objectives);
    if (exceeded != 0 && !has_row(overrun, result.run, exceeded)) {
      database.refuse(fmt::format("is damaged: overrun does not follow from the result of run {}",
                                  result.run.value));
    }
    if (!result.is_completed()) continue;
    for (std::size_t i = 0; i < worst.size(); ++i) {
      worst[i].offer({.magnitude = std::abs(result.error(i)), .run = result.run});
    }
  }
  if (overrun.step()) database.refuse("is damaged: overrun has a run too many");
  const WorstRunTable stored = read_worst_runs(database);
  for (std::size_t i = 0; i < worst.size(); ++i) {
    if (stored[i].runs() == worst[i].runs()) continue;
    database.refuse(fmt::format("is damaged: worst_run does not follow from the results of {}",
                                quantities[i].name));
  }
}

/// Deliveries of a worker.
struct Deliveries {
  std::uint64_t count = 0;
  double compute_s = 0.0;
  std::optional<std::int64_t> last_unix_s;  ///< The newest of them.
};

std::map<std::int64_t, Deliveries> read_deliveries(const Database& database) {
  Statement select =
      database.prepare("SELECT run_index, worker_key, compute_s, received_unix_s FROM delivery");
  std::map<std::int64_t, Deliveries> by_worker;
  while (select.step()) {
    const double compute_s = select.real(2);
    if (!(std::isfinite(compute_s) && compute_s >= 0.0)) {
      database.refuse_as_damaged(
          fmt::format("delivery.compute_s of run {} = {} (must be finite and at least 0)",
                      select.integer(0), compute_s));
    }
    Deliveries& deliveries = by_worker[select.integer(1)];
    ++deliveries.count;
    deliveries.compute_s += compute_s;
    deliveries.last_unix_s =
        std::max(deliveries.last_unix_s.value_or(select.integer(3)), select.integer(3));
  }
  return by_worker;
}

// Each order of adding rounds in its own way, and the worker's sum was made of those of commits.
// Two sums of n terms that are not negative differ by n epsilon of their value at most.
bool are_close(double stored_s, const Deliveries& deliveries) {
  const double tolerance = static_cast<double>(deliveries.count) *
                           std::numeric_limits<double>::epsilon() * deliveries.compute_s;
  return std::abs(stored_s - deliveries.compute_s) <= tolerance;
}

std::string shown(std::optional<std::int64_t> time_unix_s) {
  return time_unix_s ? fmt::to_string(*time_unix_s) : "NULL";
}

// `num_results`, `compute_s` and `last_result_unix_s` of a worker follow from its deliveries. A
// second delivery of a run counts for nobody.
void check_workers(const Database& database) {
  const std::map<std::int64_t, Deliveries> by_worker = read_deliveries(database);
  Statement select = database.prepare(
      "SELECT worker_key, num_results, compute_s, last_result_unix_s FROM worker"
      " ORDER BY worker_key");
  while (select.step()) {
    const auto found = by_worker.find(select.integer(0));
    const Deliveries deliveries = found == by_worker.end() ? Deliveries{} : found->second;
    if (select.count(1) != deliveries.count) {
      database.refuse_as_damaged(
          fmt::format("worker.num_results of worker_key {} = {} (must be {}, its deliveries)",
                      select.integer(0), select.integer(1), deliveries.count));
    }
    if (!are_close(select.real(2), deliveries)) {
      database.refuse_as_damaged(
          fmt::format("worker.compute_s of worker_key {} = {} (must be {}, of its deliveries)",
                      select.integer(0), select.real(2), deliveries.compute_s));
    }
    if (select.shown(3) != shown(deliveries.last_unix_s)) {
      database.refuse_as_damaged(fmt::format(
          "worker.last_result_unix_s of worker_key {} = {} (must be {}, of its deliveries)",
          select.integer(0), select.shown(3), shown(deliveries.last_unix_s)));
    }
  }
}

// An audit has the digest of the stored result, and is equal if the second one has the same.
void check_audits(const Database& database) {
  Statement select = database.prepare(
      "SELECT run_index, worker_key, stored_digest, second_digest, is_equal FROM audit");
  ResultRows results(database);
  while (select.step()) {
    const std::string row =
        fmt::format("run {} by worker_key {}", select.count(0), select.integer(1));
    const std::string must = hexadecimal(digest(results.read(RunIndex{select.count(0)})));
    if (select.text(2) != must) {
      database.refuse_as_damaged(
          fmt::format("audit.stored_digest of {} = {} (must be {})", row, select.text(2), must));
    }
    const bool is_equal = select.text(2) == select.text(3);
    if ((select.integer(4) != 0) == is_equal) continue;
    database.refuse_as_damaged(fmt::format("audit.is_equal of {} = {} (must be {}, as the digests)",
                                           row, select.integer(4), std::int64_t{is_equal}));
  }
}

struct Row {
  std::string name;
  std::vector<std::string> cells;
};

struct Content {
  std::vector<std::string> columns;
  std::vector<Row> rows;
  std::map<std::string, std::size_t> places;  ///< Of the rows, by name.

  [[nodiscard]] const Row* find(const std::string& name) const {
    const auto found = places.find(name);
    return found == places.end() ? nullptr : &rows[found->second];
  }
};

Content content_of(const Database& database, const ComparedTable& table) {
  Statement select = database.prepare(
      fmt::format("SELECT {}, {} FROM {}", table.row_name, table.columns, table.name));
  Content content;
  for (int column = 1; column < select.num_columns(); ++column) {
    content.columns.push_back(select.column_name(column));
  }
  while (select.step()) {
    Row& row = content.rows.emplace_back(Row{.name = select.text(0), .cells = {}});
    content.places.emplace(row.name, content.rows.size() - 1);
    for (int column = 1; column < select.num_columns(); ++column) {
      row.cells.push_back(select.shown(column));
    }
  }
  return content;
}

/// Numbers that agree but for what another processor or another version of Boost.Math rounds.
bool agree(const std::string& stored, const std::string& expected, double tolerance) {
  if (stored == expected) return true;
  const auto number_in = [](const std::string& text) {
    double number = std::numeric_limits<double>::quiet_NaN();
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return end == text.data() + text.size() ? number : std::numeric_limits<double>::quiet_NaN();
  };
  const double a = number_in(stored), b = number_in(expected);
  return std::abs(a - b) <= tolerance * std::max(std::abs(a), std::abs(b));
}

void compare(const ComparedTable& table, const Content& stored, const Content& expected,
             FurtherRows further, std::vector<std::string>& differences) {
  for (const Row& must : expected.rows) {
    const Row* const row = stored.find(must.name);
    if (row == nullptr) {
      differences.push_back(fmt::format("{} lacks {}", table.name, must.name));
      continue;
    }
    for (std::size_t i = 0; i < must.cells.size(); ++i) {
      if (agree(row->cells[i], must.cells[i], table.tolerance)) continue;
      differences.push_back(fmt::format("{}.{} of {} = {} (must be {})", table.name,
                                        expected.columns[i], must.name, row->cells[i],
                                        must.cells[i]));
    }
  }
  if (further == FurtherRows::ignore) return;
  for (const Row& row : stored.rows) {
    if (expected.find(row.name) != nullptr) continue;
    differences.push_back(fmt::format("{} has a row too many: {}", table.name, row.name));
  }
}

}  // namespace

std::string compute_table_digest(const Database& database) {
  Sha256 hash;
  add_campaign(database, hash);
  add_data_tables(database, hash);
  add_dispersions(database, hash);
  return hash.finish();
}

void write_table_digest(const Database& database) {
  database.prepare("UPDATE campaign SET table_digest = ?").run(compute_table_digest(database));
}

void check_integrity(const Database& database) {
  const std::string finding = database.text("PRAGMA integrity_check(1)");
  if (finding != "ok") database.refuse_as_damaged(finding);
  check_schema(database, schema_version());
  check_references(database);
  check_single_rows(database);
  check_largest_errors(database);
  check_workers(database);
  check_audits(database);
}

std::vector<std::string> table_differences(const Database& database,
                                           const std::function<void(Database&)>& write,
                                           std::span<const ComparedTable> tables,
                                           FurtherRows further) {
  Database expected("new campaign", Access::memory);
  Transaction transaction(expected);
  migrate(expected);
  write(expected);
  std::vector<std::string> differences;
  for (const ComparedTable& table : tables) {
    compare(table, content_of(database, table), content_of(expected, table), further, differences);
  }
  return differences;
}

}  // namespace proofmass::coordinator::detail
