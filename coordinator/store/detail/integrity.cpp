#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator::detail {
namespace {

// How the campaign is served is left out: it changes while a coordinator has the file.
void add_campaign(const Database& database, Sha256& hash) {
  const Statement row = database.first_row(
      "SELECT name, seed, num_runs, definition, model_version, build, created_utc, campaign_uid,"
      " owner, stop_rule, num_runs_max, failures_max, num_runs_fixed, model_description,"
      " reference_digest FROM campaign");
  const int num_always = row.num_columns() - 3;
  for (int column = 0; column < num_always; ++column) hash.add(row.shown(column));
  if (row.optional_count(num_always)) hash.add(row.shown(num_always));
  for (const int column : {num_always + 1, num_always + 2}) {
    if (const std::string text = row.text(column); !text.empty()) hash.add(text);
  }
}

void add_data_tables(const Database& database, const Model& model, Sha256& hash) {
  for (const DataTableSchema& table : model.tables()) {
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
void check_largest_errors(const Database& database, const ResultSchema& schema) {
  const std::vector<double> objectives = read_objectives(database, schema);
  WorstRunTable worst(schema.quantities.size());
  Statement overrun =
      database.prepare("SELECT run_index, parameters FROM overrun ORDER BY run_index");
  ResultReader results(database, schema);
  while (const std::optional<RunResult> result = results.next()) {
    const std::uint64_t exceeded = exceeded_objectives(*result, objectives);
    if (exceeded != 0 && !has_row(overrun, result->run, exceeded)) {
      database.refuse(fmt::format("is damaged: overrun does not follow from the result of run {}",
                                  result->run.value));
    }
    if (!result->is_completed()) continue;
    for (std::size_t i = 0; i < worst.size(); ++i) {
      offer(worst[i], {.magnitude = std::abs(result->error(i)), .run = result->run});
    }
  }
  if (overrun.step()) database.refuse("is damaged: overrun has a run too many");
  const WorstRunTable stored = read_worst_runs(database, schema);
  for (std::size_t i = 0; i < worst.size(); ++i) {
    if (stored[i] == worst[i]) continue;
    database.refuse(fmt::format("is damaged: worst_run does not follow from the results of {}",
                                schema.quantities[i].name));
  }
}

// `num_results`, `compute_s` and `last_result_unix_s` of a worker follow from its deliveries. A
// second delivery of a run counts for nobody. Each order of adding times rounds in its own way, and
// the worker's sum was made of those of commits: two sums of n terms that are not negative differ
// by n epsilon of their value at most.
void check_workers(const Database& database) {
  Statement odd = database.prepare(
      "SELECT run_index, compute_s FROM delivery WHERE NOT (compute_s >= 0 AND compute_s < 9e999)");
  if (odd.step()) {
    database.refuse_as_damaged(
        fmt::format("delivery.compute_s of run {} = {} (must be finite and at least 0)",
                    odd.integer(0), odd.real(1)));
  }
  Statement select = database.prepare(
      "SELECT worker_key, w.num_results, w.compute_s, last_result_unix_s, ifnull(d.num_results, 0),"
      " ifnull(d.compute_s, 0.0), last_unix_s FROM worker AS w LEFT JOIN"
      " (SELECT worker_key, count(*) AS num_results, total(compute_s) AS compute_s,"
      "  max(received_unix_s) AS last_unix_s FROM delivery GROUP BY worker_key) AS d"
      " USING (worker_key) ORDER BY worker_key");
  while (select.step()) {
    const auto require = [&](bool holds, int column, std::string_view whose) {
      if (holds) return;
      database.refuse_as_damaged(fmt::format(
          "worker.{} of worker_key {} = {} (must be {}, {} deliveries)", select.column_name(column),
          select.integer(0), select.shown(column), select.shown(column + 3), whose));
    };
    const double tolerance = static_cast<double>(select.count(4)) *
                             std::numeric_limits<double>::epsilon() * select.real(5);
    require(select.integer(1) == select.integer(4), 1, "its");
    require(std::abs(select.real(2) - select.real(5)) <= tolerance, 2, "of its");
    require(select.shown(3) == select.shown(6), 3, "of its");
  }
}

// An audit has the digest of the stored result, and is equal if the second one has the same.
void check_audits(const Database& database, const ResultSchema& schema) {
  Statement select = database.prepare(
      "SELECT run_index, worker_key, stored_digest, second_digest, is_equal FROM audit");
  ResultRows results(database, schema);
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

}  // namespace

std::string compute_table_digest(const Database& database, const Model& model) {
  Sha256 hash;
  add_campaign(database, hash);
  add_data_tables(database, model, hash);
  add_dispersions(database, hash);
  return hash.finish();
}

void write_table_digest(const Database& database, const Model& model) {
  database.prepare("UPDATE campaign SET table_digest = ?")
      .run(compute_table_digest(database, model));
}

void check_integrity(const Database& database, const StoredKind& kind) {
  const ResultSchema& results = kind.results;
  const std::string finding = database.text("PRAGMA integrity_check(1)");
  if (finding != "ok") database.refuse_as_damaged(finding);
  check_schema(database, schema_version(), *kind.model, results);
  check_constraints(database);
  check_references(database);
  check_single_rows(database);
  check_largest_errors(database, results);
  check_workers(database);
  check_audits(database, results);
}

}  // namespace proofmass::coordinator::detail
