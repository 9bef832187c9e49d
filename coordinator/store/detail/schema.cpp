#include "coordinator/store/detail/schema.hpp"

#include <fmt/args.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "coordinator/store/detail/rows.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "proto/link/faults.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::string_view next_column = ",\n  ";

/// What `text_of` yields for each item, with the separator between them.
template <typename Items, typename TextOf>
std::string joined(const Items& items, std::string_view separator, const TextOf& text_of) {
  std::string text;
  for (const auto& item : items) {
    if (!text.empty()) text += separator;
    text += text_of(item);
  }
  return text;
}

/// Columns of run_result with the standard errors and their fit, if the campaign has them.
std::vector<std::string> columns_of_standard_errors(const ResultSchema& schema) {
  std::vector<std::string> names;
  for (const ValueColumn& column : value_columns(schema)) {
    if (is_of_standard_errors(column)) names.push_back(column.name);
  }
  return names;
}

/// Columns that are NULL where `is_absent` holds.
std::string nullable_columns(const ResultSchema& schema, std::string_view prefix,
                             std::string_view is_absent) {
  return joined(schema.quantities, next_column, [&](const Quantity& quantity) {
    const std::string name = fmt::format("{}_{}", prefix, quantity.column());
    return fmt::format("{0} REAL CHECK (({0} IS NULL) = ({1}))", name, is_absent);
  });
}

std::string error_columns(const ResultSchema& schema) {
  return joined(schema.quantities, next_column, [](const Quantity& quantity) {
    return fmt::format("error_{0} REAL AS (estimate_{0} - truth_{0})", quantity.column());
  });
}

/// The columns that the schema has from version 10.
std::string added_columns(const ResultSchema& schema) {
  std::string text = joined(columns_of_standard_errors(schema), "", [](const std::string& column) {
    return fmt::format("ALTER TABLE run_result ADD COLUMN {} REAL;\n", column);
  });
  if (text.empty()) return text;
  if (num_correlations(schema) > 0) {
    text += "ALTER TABLE run_result ADD COLUMN correlations TEXT;\n";
  }
  return text + fmt::format(
                    "CREATE INDEX run_result_standard_errors ON run_result (run_index)\n"
                    "WHERE {};\n",
                    has_standard_errors_sql(schema));
}

std::string data_tables(const Model& model) {
  return joined(model.tables(), "", [](const DataTableSchema& table) {
    const std::string columns = joined(table.columns, "", [](std::string_view column) {
      return fmt::format(",\n  {} REAL NOT NULL", column);
    });
    return fmt::format("-- {}\nCREATE TABLE {} (\n  position INTEGER PRIMARY KEY{}\n) STRICT;\n",
                       table.comment, table.table, columns);
  });
}

std::string digested_tables(const Model& model) {
  const std::string text = joined(model.tables(), ", ", std::mem_fn(&DataTableSchema::table));
  return text.empty() ? "dispersion_value" : text + " and dispersion_value";
}

/// The format for the column of each quantity of health or fit, one after the other.
std::string columns_as(fmt::format_string<std::string> format,
                       const std::vector<HealthQuantity>& quantities) {
  return joined(quantities, "", [&](const HealthQuantity& quantity) {
    return fmt::format(format, quantity.column());
  });
}

/// @param has_one  Of the quantities; those without one are NULL.
std::string value_of_parameter(const ResultSchema& schema, std::string_view prefix,
                               const std::function<bool(const Quantity&)>& has_one = {}) {
  int position = 0;
  const std::string text = joined(schema.quantities, "", [&](const Quantity& quantity) {
    ++position;
    return !has_one || has_one(quantity)
               ? fmt::format("\n         WHEN {} THEN r.{}_{}", position, prefix, quantity.column())
               : std::string();
  });
  return text.empty() ? "NULL" : "CASE p.position" + text + " END";
}

std::string budget_total(const ResultSchema& schema) {
  return joined(schema.quantities, "\n       + ", [](const Quantity& quantity) {
    return fmt::format(
        "abs(error_{}) * (SELECT ifnull(sum(value), 0.0) FROM budget_coefficient"
        " WHERE parameter = '{}')",
        quantity.column(), quantity.name);
  });
}

/// Of the row r of run_result; what the schema has from version 9.
std::string budget_total_at_level(const ResultSchema& schema) {
  if (schema.budget_terms.empty()) return "NULL";
  const std::string level = schema.health.at(schema.budget_level).column();
  return joined(schema.quantities, "\n       + ", [&](const Quantity& quantity) {
    return fmt::format(
        "abs(r.error_{0}) * (SELECT ifnull(sum(value), 0.0) FROM budget_coefficient"
        " WHERE parameter = '{1}' AND assumed_level IS NULL)\n"
        "       + abs(r.error_{0}) * coalesce(nullif(r.health_{2}, 0.0), (SELECT "
        "max(assumed_level) FROM"
        " budget_coefficient))\n         * (SELECT ifnull(sum(value / assumed_level), 0.0) FROM"
        " budget_coefficient WHERE parameter = '{1}')",
        quantity.column(), quantity.name, level);
  });
}

/// The names of choices that are stored as 1, 2, ...
std::string name_of_choice(std::string_view column, const std::vector<std::string_view>& names) {
  if (names.empty()) return "NULL";
  std::size_t number = 0;
  const std::string text = joined(names, "", [&](std::string_view name) {
    return fmt::format("\n         WHEN {} THEN '{}'", ++number, name);
  });
  return fmt::format("CASE r.{}{} END", column, text);
}

std::vector<std::string_view> status_names() {
  std::vector<std::string_view> names;
  for (int value = 1; value <= static_cast<int>(RunStatus::lost); ++value) {
    names.push_back(name_of(static_cast<RunStatus>(value)));
  }
  return names;
}

std::map<const char*, std::string> texts(const Model& model, const ResultSchema& schema) {
  return {
      {"data_tables", data_tables(model)},
      {"digested_tables", digested_tables(model)},
      {"example_quantity", example_quantity(schema).name},
      {"truth_columns", nullable_columns(schema, "truth", "status = 4")},
      {"estimate_columns", nullable_columns(schema, "estimate", "status > 2")},
      {"error_columns", error_columns(schema)},
      {"standard_error_columns", ""},  // In version 8 no model had any.
      {"added_columns", added_columns(schema)},
      {"standard_error_of_parameter",
       value_of_parameter(schema, "standard_error", std::mem_fn(&Quantity::has_standard_error))},
      {"fit_values", columns_as(", r.fit_{0} AS {0}", schema.fit)},
      {"health_columns", columns_as("health_{0} REAL,\n  ", schema.health)},
      {"health_values", columns_as("r.health_{0} AS {0},\n       ", schema.health)},
      {"status_name", name_of_choice("status", status_names())},
      {"loss_cause_name", name_of_choice("loss_cause", schema.loss_causes)},
      {"loss_session_name", name_of_choice("loss_session", schema.loss_sessions)},
      {"truth_of_parameter", value_of_parameter(schema, "truth")},
      {"estimate_of_parameter", value_of_parameter(schema, "estimate")},
      {"error_of_parameter", value_of_parameter(schema, "error")},
      {"budget_total", budget_total(schema)},
      {"budget_total_at_level", budget_total_at_level(schema)},
      {"num_causes", std::to_string(schema.loss_causes.size())},
      {"cause_names", fmt::format("{}", fmt::join(schema.loss_causes, ", "))},
      {"num_sessions", std::to_string(schema.loss_sessions.size())},
      {"session_names", fmt::format("{}", fmt::join(schema.loss_sessions, ", "))},
  };
}

}  // namespace

std::string has_standard_errors_sql(const ResultSchema& schema) {
  std::vector<std::string> columns = columns_of_standard_errors(schema);
  if (num_correlations(schema) > 0) columns.emplace_back("correlations");
  return joined(columns, "\n   OR ", [](const auto& column) { return column + " IS NOT NULL"; });
}

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
  fmt::dynamic_format_arg_store<fmt::format_context> words;
  for (const auto& [word, text] : texts(model, results)) words.push_back(fmt::arg(word, text));
  std::vector<std::string> steps;
  for (const std::string_view file : schema_files()) steps.push_back(fmt::vformat(file, words));
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

namespace {

/// The conditions of the CHECK constraints of a table.
/// @param sql  A definition of schema/: no quoted text in it has a parenthesis.
std::vector<std::string> conditions_of(const std::string& sql) {
  constexpr std::string_view check = "CHECK (";
  std::vector<std::string> conditions;
  for (std::size_t at = sql.find(check); at != std::string::npos; at = sql.find(check, at)) {
    at += check.size();
    std::size_t end = at;
    for (int depth = 1; depth > 0; ++end) depth += sql[end] == '(' ? 1 : (sql[end] == ')' ? -1 : 0);
    conditions.push_back(sql.substr(at, end - 1 - at));
  }
  return conditions;
}

}  // namespace

void check_constraints(const Database& database) {
  for (const std::string& table : table_names(database)) {
    const std::vector<std::string> conditions = conditions_of(without_comments(
        database.text(fmt::format("SELECT sql FROM sqlite_schema WHERE name = '{}'", table))));
    if (conditions.empty()) continue;
    const std::string failing = fmt::format("SELECT count(*) FROM \"{}\" WHERE NOT ({})", table,
                                            fmt::join(conditions, ") OR NOT ("));
    if (database.count(failing) == 0) continue;
    database.refuse_as_damaged("CHECK constraint failed in " + table);
  }
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

}  // namespace proofmass::coordinator::detail
