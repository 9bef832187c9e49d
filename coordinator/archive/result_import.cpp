#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/export.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/store/store.hpp"
#include "core/definition/csv.hpp"
#include "core/definition/document.hpp"
#include "core/statistics/independence.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t schema_size_max = std::size_t{1} << 20;
constexpr std::size_t results_size_max = std::size_t{2} << 30;
constexpr std::size_t inputs_max = 900;  // A model draws 1,000 at most, and the truths are of them.

/// A column of the results: its heading, and a number for each run.
struct ResultColumn {
  std::string heading;
  bool may_be_missing = false;  ///< Then its value is NaN.
  bool is_positive = false;     ///< A standard error: other numbers are mistakes.
  std::size_t position = 0;
  std::vector<double> values = {};
};

using ResultColumns = std::vector<ResultColumn>;

/// What a schema says of the columns, and the description of a model that it amounts to.
struct ImportSchema {
  std::string name = {};
  bool is_independent = false;
  std::uint64_t num_runs = 0;  ///< That was fixed before the first result; 0: none.
  ResultColumns drawn = {};    ///< In the order of the description; the last ones are the truths.
  ResultColumns estimates = {};
  ResultColumns errors = {};  ///< Of the quantities that have one.
  Json description = {};
};

/// Copies a key into the description, if it is there.
template <typename Value>
void copy_key(Document& document, const std::string& path, const char* key, Json& entry) {
  Value value{};
  if (document.read(fmt::format("{}.{}", path, key), value)) entry[key] = value;
}

/// @param column_key  The key that names the column, unless it is `column`.
void read_drawn(Document& document, const std::string& path, const std::string& name,
                const char* column_key, std::string column, ImportSchema& schema) {
  document.read(fmt::format("{}.{}", path, column_key), column);
  Json drawn{{"name", name},
             {"law", "table"},
             {"file", schema.description["imported_from"]},
             {"column", column},
             {"independent", schema.is_independent}};
  copy_key<std::string>(document, path, "unit", drawn);
  schema.description["drawn"].push_back(std::move(drawn));
  schema.drawn.push_back({.heading = std::move(column)});
}

void read_quantity(Document& document, const std::string& path, ImportSchema& schema) {
  const std::string name = wire::read_name(document, path);
  read_drawn(document, path, name, "truth", "truth_" + name, schema);
  std::string estimate = "estimate_" + name, error;
  document.read(path + ".estimate", estimate);
  const bool has_error = document.read(path + ".standard_error", error);
  schema.estimates.push_back({.heading = std::move(estimate), .may_be_missing = true});
  if (has_error) {
    schema.errors.push_back(
        {.heading = std::move(error), .may_be_missing = true, .is_positive = true});
  }
  Json quantity{{"name", name}, {"truth", name}, {"standard_error", has_error}};
  for (const char* const key : {"symbol", "unit", "display_unit"}) {
    copy_key<std::string>(document, path, key, quantity);
  }
  for (const char* const key : {"objective", "display_scale"}) {
    copy_key<double>(document, path, key, quantity);
  }
  if (quantity.contains("display_unit") && !quantity.contains("display_scale")) {
    document.refuse_absence(path + ".display_scale", "display_unit needs it");
  }
  schema.description["quantities"].push_back(std::move(quantity));
}

ImportSchema read_schema(Document& document, const std::string& file) {
  ImportSchema schema;
  document.read_needed("campaign.name", schema.name);
  document.read("campaign.independent", schema.is_independent);
  document.read("campaign.runs", schema.num_runs, range::between(1.0, 1e9));
  schema.description = {{"proofmass_model_program", 1}, {"name", schema.name},
                        {"version", "imported"},        {"imported_from", file},
                        {"drawn", Json::array()},       {"quantities", Json::array()}};
  const std::size_t num_inputs = document.num_tables("drawn", inputs_max).value_or(0);
  for (std::size_t i = 0; i < num_inputs; ++i) {
    const std::string path = fmt::format("drawn[{}]", i);
    const std::string name = wire::read_name(document, path);
    read_drawn(document, path, name, "column", name, schema);
  }
  const auto num_quantities = document.num_tables("quantities", quantities_max);
  if (num_quantities.value_or(0) == 0) {
    document.refuse_absence("quantities", "must be a list of tables [[quantities]]");
  }
  for (std::size_t i = 0; i < num_quantities.value_or(0); ++i) {
    read_quantity(document, fmt::format("quantities[{}]", i), schema);
  }
  document.check();
  return schema;
}

double number_in(const CsvReader& reader, const ResultColumn& column) {
  static constexpr std::string_view others[] = {"", "nan", "inf", "-inf", "null"};
  std::string cell(reader.cells()[column.position]);
  std::ranges::transform(cell, cell.begin(), [](unsigned char c) { return std::tolower(c); });
  if (column.may_be_missing && std::ranges::find(others, cell) != std::end(others)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double value = reader.number(column.position, column.heading);
  if (column.is_positive && value <= 0.0) {
    reader.refuse(fmt::format("{} = {} (must be > 0)", column.heading, value));
  }
  if (column.may_be_missing || is_in_range(value)) return value;
  reader.refuse(fmt::format("{} = {} (must be in [-{:g}, {:g}])", column.heading, value,
                            magnitude_max, magnitude_max));
}

/// Reads the values of all columns.
/// @return The number of runs.
std::size_t read_columns(const std::filesystem::path& file, ImportSchema& schema,
                         const HeedStop& heed_stop) {
  const std::string name = file.string();
  const std::string text =
      detail::read_definition_text(file, results_size_max, detail::Pipes::accepted);
  CsvReader reader(text, name);
  if (!reader.next_row()) reader.refuse("the file is empty; its first line must hold headings");
  const std::size_t num_cells = reader.cells().size();
  std::vector<ResultColumn*> columns;
  for (ResultColumns* const group : {&schema.drawn, &schema.estimates, &schema.errors}) {
    for (ResultColumn& column : *group) {
      column.position = reader.position_of(column.heading);
      columns.push_back(&column);
    }
  }
  while (reader.next_row()) {
    heed_stop();
    reader.expect_cells(num_cells);
    for (ResultColumn* const column : columns) column->values.push_back(number_in(reader, *column));
  }
  const std::size_t num_runs = columns.front()->values.size();
  if (num_runs == 0) reader.refuse("no line after that of the headings");
  if (schema.num_runs != 0 && schema.num_runs != num_runs) {
    reader.refuse(
        fmt::format("{} lines after that of the headings (the schema's campaign.runs, "
                    "fixed before the first result, is {})",
                    num_runs, schema.num_runs));
  }
  return num_runs;
}

RunResult result_of(const ImportSchema& schema, std::size_t run) {
  const auto row = [run](std::span<const ResultColumn> columns) {
    std::vector<double> values;
    for (const ResultColumn& column : columns) values.push_back(column.values[run]);
    return values;
  };
  std::vector<double> estimate = row(schema.estimates);
  RunResult result{.run = RunIndex{run},
                   .num_draws = 1,
                   .truth = row(std::span(schema.drawn).last(estimate.size()))};
  if (std::ranges::none_of(estimate, is_in_range)) {
    wire::set_lost(result);
  } else {
    wire::set_estimates(std::move(estimate), row(schema.errors), result);
  }
  return result;
}

/// Truths may be independent where errors are not: the lines may be in the order of their errors.
void check_errors(const ImportSchema& schema, const wire::DescribedCampaign& campaign) {
  if (!schema.is_independent) return;
  const std::size_t num_inputs = schema.drawn.size() - schema.estimates.size();
  for (std::size_t i = 0; i < schema.estimates.size(); ++i) {
    std::vector<double> errors;
    for (std::size_t run = 0; run < campaign.num_runs; ++run) {
      const double estimate = schema.estimates[i].values[run];
      if (is_in_range(estimate)) {
        errors.push_back(estimate - schema.drawn[num_inputs + i].values[run]);
      }
    }
    const std::string why = why_dependent(errors);
    if (why.empty()) continue;
    throw ConfigError(
        "campaign.independent", "true",
        fmt::format("{} - {} {}; leave the key out, or draw each row anew",
                    schema.estimates[i].heading, schema.drawn[num_inputs + i].heading, why));
  }
}

/// What a schema says that the campaign does not allow.
void check(const ImportSchema& schema, const wire::DescribedCampaign& campaign,
           const std::string& file) {
  try {
    campaign.validate();
    check_independence(campaign.law_set(), campaign);
    check_errors(schema, campaign);
  } catch (const ConfigError& error) {
    // All columns have the one key of the schema.
    constexpr std::string_view key = ".independent";
    const std::string& field = error.field();
    const std::string text = std::string(error.what()).substr(field.size());
    throw DefinitionError(
        fmt::format("{}: {}{}", file, field.ends_with(key) ? "campaign.independent" : field, text));
  }
}

/// Some of what the database has from the beginning; nothing after the last run.
/// @param missing  Counts the runs without an estimate among them.
std::vector<Entry> entries_of(const ImportSchema& schema, std::uint64_t first_run,
                              std::uint64_t end_run, std::uint64_t num_runs,
                              MissingEstimates& missing) {
  constexpr wire::SessionId importer{1};
  if (first_run == num_runs) return {};
  std::vector<Entry> entries;
  if (first_run == 0) {
    entries.push_back(WorkerJoined{.session = importer,
                                   .name = "import",
                                   .host = wire::host_name(),
                                   .process_id = static_cast<std::uint64_t>(getpid())});
  }
  for (std::uint64_t run = first_run; run < end_run; ++run) {
    RunResult result = result_of(schema, run);
    missing.add(result);
    entries.push_back(Delivery{.result = std::move(result), .worker = importer, .attempt = {1}});
  }
  if (end_run == num_runs) {
    entries.push_back(WorkerEnded{.session = importer, .reason = wire::LossReason::drained});
    entries.push_back(CampaignControl{.phase = wire::CampaignPhase::finished});
  }
  return entries;
}

}  // namespace

MissingEstimates import_results(const std::filesystem::path& results,
                                const std::filesystem::path& schema_file,
                                const std::filesystem::path& database, const HeedStop& heed_stop) {
  Document document(
      schema_file.string(),
      detail::read_definition_text(schema_file, schema_size_max, detail::Pipes::refused), {});
  ImportSchema schema = read_schema(document, results.filename().string());
  const wire::DescribedModel& model =
      wire::described_model(schema.description.dump(), 0, schema_file.string());
  check_names(model, schema_file.string());
  wire::DescribedCampaign campaign(model);
  campaign.name = schema.name;
  campaign.num_runs = read_columns(results, schema, heed_stop);
  for (const ResultColumn& column : schema.drawn) campaign.table_columns.push_back(column.values);
  check(schema, campaign, schema_file.string());
  MissingEstimates missing;
  std::uint64_t next_run = 0;
  const auto next_entries = [&] {
    heed_stop();
    constexpr std::uint64_t batch_size = 10'000;
    const std::uint64_t end_run = std::min(campaign.num_runs, next_run + batch_size);
    return entries_of(schema, std::exchange(next_run, end_run), end_run, campaign.num_runs,
                      missing);
  };
  Store store = Store::create_with_results(database, campaign,
                                           campaign.definition(TableColumns::left_out).text,
                                           schema.num_runs != 0, next_entries);
  update_statistics(store, campaign);
  return missing;
}

}  // namespace proofmass::coordinator
