#include "coordinator/store/detail/schema.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "coordinator/store/detail/rows.hpp"
#include "proto/link/faults.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// Steps of SQLite's machine that reading a schema may take; that of a campaign takes some 1,000.
constexpr int steps_of_schema_max = 100'000;

/// Definitions by kind and name: `view budget`.
using SchemaObjects = std::map<std::string, std::string>;

// The columns `type` and `name` say what SQLite believes only if the definition agrees, and all
// three are compared. That a name occurs once is checked, as the second row of a name would not be
// compared.
SchemaObjects schema_objects(const Database& database) {
  Statement select = database.prepare(
      "SELECT type || ' ' || name, tbl_name || ': ' || coalesce(sql, '') FROM sqlite_schema");
  SchemaObjects objects;
  while (select.step()) {
    const bool is_new = objects.emplace(select.text(0), select.text(1)).second;
    if (!is_new) database.refuse("has two definitions of " + select.text(0));
  }
  return objects;
}

/// What a file has that was brought to a version, for each from oldest_schema_version. Making it
/// takes some milliseconds, so that a thread keeps those of the last campaign: others of a
/// directory mostly have the same.
const std::vector<SchemaObjects>& known_schemas(const Model& model, const ResultSchema& results) {
  thread_local std::vector<std::string> known_migrations;
  thread_local std::vector<SchemaObjects> known;
  std::vector<std::string> wanted = migrations(model, results);
  if (wanted == known_migrations) return known;
  Database fresh("new campaign", Access::memory);
  std::vector<SchemaObjects> all;
  for (const std::string& migration : wanted) {
    fresh.execute(migration);
    all.push_back(schema_objects(fresh));
  }
  known = std::move(all);
  known_migrations = std::move(wanted);
  return known;
}

/// Place of a version's step among migrations().
std::size_t step_to(std::int64_t version) {
  return static_cast<std::size_t>(version - oldest_schema_version);
}

std::int64_t version_of(const Database& database) {
  const std::int64_t version = database.integer("PRAGMA user_version");
  if (version > schema_version()) {
    database.refuse(
        fmt::format("is newer than this program: its user_version is {}, the newest known one {}",
                    version, schema_version()));
  }
  if (version < 1) database.refuse_as_damaged(fmt::format("user_version = {}", version));
  if (version < oldest_schema_version) {
    database.refuse(
        fmt::format("was made before the first release: its user_version is {}, the oldest known "
                    "one {}",
                    version, oldest_schema_version));
  }
  return version;
}

// Tables of as many rows as the campaign has runs, workers or lines of its data files: their pages
// are checked when they are read.
constexpr std::array<std::string_view, 9> large_tables{
    "attempt",    "audit",       "delivery", "dispersion_value", "overrun", "run_failure",
    "run_result", "run_warning", "worker"};

bool is_large(const Model& model, const std::string& table) {
  return std::ranges::find(large_tables, table) != large_tables.end() ||
         std::ranges::find(model.tables(), table, &DataTableSchema::table) != model.tables().end();
}

/// Names of the tables, those of SQLite's own among them.
std::vector<std::string> table_names(const Database& database) {
  return rows_of(
      database,
      "SELECT name FROM sqlite_schema WHERE type = 'table' AND rootpage > 0 ORDER BY name",
      [](const Statement& row) { return row.text(0); });
}

// Counting the rows of a table reads every page of its tree, and SQLite checks each that it reads.
std::uint64_t count_rows(const Database& database, const std::string& table) {
  return database.count(fmt::format("SELECT count(*) FROM \"{}\" NOT INDEXED", table));
}

// SQLite holds the size of the file against its header with the first page that it reads.
void check_small_tables(const Database& database, const Model& model) {
  for (const std::string& table : table_names(database)) {
    if (!is_large(model, table)) {
      (void)count_rows(database, table);
    } else {
      database.prepare(fmt::format("SELECT 1 FROM \"{}\" NOT INDEXED LIMIT 1", table)).finish();
    }
  }
}

/// What SQLite sees: comments name tables of the model.
std::string without_comments(std::string_view sql) {
  std::string text;
  while (!sql.empty()) {
    const std::string_view line = sql.substr(0, sql.find('\n'));
    text += line.substr(0, line.find("--"));
    text += '\n';
    sql.remove_prefix(std::min(line.size() + 1, sql.size()));
  }
  return text;
}

// Nothing of a file may be evaluated before its definition has been compared. That of the table
// `campaign` does not depend on what the results are.
StoredKind stored_kind(const Database& database, std::int64_t version) {
  constexpr std::string_view table = "table campaign";
  constexpr std::int64_t first_with_description = 12, first_with_digest = 13;
  StoredKind of_example{.model = &model(), .results = example_results()};
  const SchemaObjects objects = schema_objects(database);
  const auto found = objects.find(std::string(table));
  const SchemaObjects& expected =
      known_schemas(*of_example.model, of_example.results).at(step_to(version));
  if (found == objects.end() ||
      without_comments(found->second) != without_comments(expected.at(found->first))) {
    return of_example;
  }
  Statement row =
      database.prepare(fmt::format("SELECT definition, model_version, {}, {} FROM campaign",
                                   version < first_with_description ? "''" : "model_description",
                                   version < first_with_digest ? "''" : "reference_digest"));
  if (!row.step()) return of_example;
  try {
    const Model& model =
        wire::recorded_model({.version = row.text(1),
                              .description = row.text(2),
                              .reference_digest = reference_digest_in(database, row.text(3))});
    return {.model = &model, .results = model.results_of(row.text(0), row.text(1))};
  } catch (const DefinitionError& error) {
    database.refuse(error.what());
  }
}

}  // namespace

std::vector<std::string> migrations(const Model& model, const ResultSchema& results) {
  std::vector<std::string> steps;
  for (const std::string_view file : schema_files()) {
    steps.push_back(with_quantities(file, model, results));
  }
  return steps;
}

std::int64_t schema_version() {
  return oldest_schema_version + static_cast<std::int64_t>(schema_files().size()) - 1;
}

StoredKind check_kind(Database& database) {
  const std::int64_t id = database.integer("PRAGMA application_id");
  if (id != application_id) {
    database.refuse(fmt::format("is not a Proofmass campaign: its application_id is {}, not {}", id,
                                application_id));
  }
  // A coordinator that brings the file up to date changes version and schema together.
  const ReadTransaction one_state(database);
  const StepLimit limit(database, steps_of_schema_max);
  const std::int64_t version = version_of(database);
  StoredKind kind = stored_kind(database, version);
  check_schema(database, version, *kind.model, kind.results);
  return kind;
}

StoredKind check_campaign_file(Database& database) {
  StoredKind kind = check_kind(database);
  check_small_tables(database, *kind.model);
  const std::int64_t num_campaigns = database.integer("SELECT count(*) FROM campaign");
  if (num_campaigns != 1) database.refuse_as_damaged(fmt::format("campaigns = {}", num_campaigns));
  return kind;
}

RowCounts check_all_pages(const Database& database) {
  RowCounts counts;
  for (const std::string& table : table_names(database)) {
    counts[table] = count_rows(database, table);
  }
  return counts;
}

void check_after_unclean_end(const Database& database) {
  if (database.text("PRAGMA journal_mode") != "wal") return;
  const std::string finding = database.text("PRAGMA quick_check(1)");
  if (finding == "ok") return;
  database.refuse_as_damaged(finding);
}

void check_results(const Database& database, const RowCounts& counts) {
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  const std::uint64_t end = database.count("SELECT ifnull(max(run_index) + 1, 0) FROM run_result");
  if (end > num_runs) {
    database.refuse_as_damaged(fmt::format("result of run {}, of {} there are", end - 1, num_runs));
  }
  const auto num_rows = [&](const std::string& table) {
    const auto found = counts.find(table);
    return found == counts.end() ? 0 : found->second;
  };
  if (num_rows("run_result") == num_rows("delivery")) return;
  database.refuse_as_damaged(
      fmt::format("results = {}, deliveries = {}", num_rows("run_result"), num_rows("delivery")));
}

bool is_older(const Database& database) {
  return database.integer("PRAGMA user_version") < schema_version();
}

void check_schema(const Database& database, std::int64_t version, const Model& model,
                  const ResultSchema& results) {
  SchemaObjects expected = known_schemas(model, results).at(step_to(version));
  for (const auto& [name, sql] : schema_objects(database)) {
    const auto found = expected.find(name);
    if (found == expected.end()) database.refuse("has what is no part of a campaign: " + name);
    if (found->second != sql) database.refuse("has another definition of " + name);
    expected.erase(found);
  }
  if (!expected.empty()) database.refuse("lacks " + expected.begin()->first);
}

std::string plain_definition(std::string sql) {
  if (!sql.starts_with("CREATE TABLE")) return sql;
  const auto cut = [&sql](std::size_t begin, std::size_t end) { sql.erase(begin, end - begin); };
  constexpr std::string_view strict = " STRICT";
  const std::size_t options = sql.rfind(')') + 1;
  if (sql.find(strict, options) == options) cut(options, options + strict.size());
  if (sql.find(',', options) == options) cut(options, options + 1);
  // A column that is computed when read: `error_a REAL AS (estimate_a - truth_a)`.
  constexpr std::string_view computed = " AS (";
  for (std::size_t begin = 0; (begin = sql.find(computed, begin)) != std::string::npos;) {
    cut(begin, sql.find(')', begin) + 1);
  }
  return sql;
}

void migrate(Database& database, const Model& model, const ResultSchema& results) {
  PROOFMASS_EXPECT(database.in_transaction());
  const std::vector<std::string> steps = migrations(model, results);
  const std::int64_t before = database.integer("PRAGMA user_version");  // 0 of a new file.
  for (std::int64_t version = std::max(before + 1, oldest_schema_version);
       version <= schema_version(); ++version) {
    database.execute(steps[step_to(version)]);
    PROOFMASS_EXPECT(database.integer("PRAGMA user_version") == version);
    wire::kill_point(wire::KillPoint::while_migrating);
  }
}

void migrate_privately(Database& database, const StoredKind& kind) {
  database.go_on_with_private_copy();
  database.distrust_content();
  Transaction transaction(database);
  migrate(database, *kind.model, kind.results);
  transaction.commit();
  database.execute("PRAGMA query_only = ON");  // What would be written is lost.
}

}  // namespace proofmass::coordinator::detail
