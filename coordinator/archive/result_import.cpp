#include "coordinator/archive/result_import.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/data_file.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"
#include "core/definition/csv.hpp"
#include "core/definition/document.hpp"
#include "core/result_rules.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t schema_size_max = std::size_t{1} << 20;
constexpr std::size_t results_size_max = std::size_t{2} << 30;
constexpr std::size_t inputs_max = 900;  // A model draws 1,000 at most, and the truths are of them.

/// Columns of a quantity, by their headings.
struct QuantityColumns {
  std::string truth;
  std::string estimate;
  std::string standard_error;  ///< Empty if there is none.
};

/// What a schema says of the columns, and the description of a model that it amounts to.
struct ImportSchema {
  std::string name;
  bool is_independent = false;
  std::vector<QuantityColumns> quantities;
  Json description;
};

std::string needed_text(Document& document, const std::string& path) {
  std::string text;
  if (document.find(path) == nullptr) {
    document.refuse_absence(path, "must be given");
  } else {
    document.read(path, text);
  }
  return text;
}

/// Copies a key into the description, if it is there.
template <typename Value>
void copy_key(Document& document, const std::string& path, const char* key, Json& entry) {
  Value value{};
  if (document.read(fmt::format("{}.{}", path, key), value)) entry[key] = value;
}

Json table_law(const ImportSchema& schema, std::string name, const std::string& file,
               std::string column) {
  Json drawn{
      {"name", std::move(name)}, {"law", "table"}, {"file", file}, {"column", std::move(column)}};
  if (schema.is_independent) drawn["independent"] = true;
  return drawn;
}

/// An input beside the truths.
void read_input(Document& document, const std::string& path, const std::string& file,
                ImportSchema& schema) {
  const std::string name = needed_text(document, path + ".name");
  std::string column = name;
  document.read(path + ".column", column);
  Json drawn = table_law(schema, name, file, column);
  copy_key<std::string>(document, path, "unit", drawn);
  schema.description["drawn"].push_back(std::move(drawn));
}

void read_quantity(Document& document, const std::string& path, const std::string& file,
                   ImportSchema& schema) {
  const std::string name = needed_text(document, path + ".name");
  QuantityColumns columns{
      .truth = "truth_" + name, .estimate = "estimate_" + name, .standard_error = {}};
  document.read(path + ".truth", columns.truth);
  document.read(path + ".estimate", columns.estimate);
  document.read(path + ".standard_error", columns.standard_error);
  Json quantity{
      {"name", name}, {"truth", name}, {"standard_error", !columns.standard_error.empty()}};
  for (const char* const key : {"symbol", "unit", "display_unit"}) {
    copy_key<std::string>(document, path, key, quantity);
  }
  for (const char* const key : {"objective", "display_scale"}) {
    copy_key<double>(document, path, key, quantity);
  }
  Json drawn = table_law(schema, name, file, columns.truth);
  if (quantity.contains("unit")) drawn["unit"] = quantity["unit"];
  schema.description["drawn"].push_back(std::move(drawn));
  schema.description["quantities"].push_back(std::move(quantity));
  schema.quantities.push_back(std::move(columns));
}

ImportSchema read_schema(Document& document, const std::string& file) {
  ImportSchema schema;
  schema.name = needed_text(document, "campaign.name");
  document.read("campaign.independent", schema.is_independent);
  schema.description = {{"proofmass_model_program", 1}, {"name", schema.name},
                        {"version", "imported"},        {"imported_from", file},
                        {"drawn", Json::array()},       {"quantities", Json::array()}};
  const std::size_t num_inputs = document.num_tables("drawn", inputs_max).value_or(0);
  for (std::size_t i = 0; i < num_inputs; ++i) {
    read_input(document, fmt::format("drawn[{}]", i), file, schema);
  }
  const auto num_quantities = document.num_tables("quantities", quantities_max);
  if (num_quantities.value_or(0) == 0) {
    document.refuse_absence("quantities", "must be a list of tables [[quantities]]");
  }
  for (std::size_t i = 0; i < num_quantities.value_or(0); ++i) {
    read_quantity(document, fmt::format("quantities[{}]", i), file, schema);
  }
  document.check();
  return schema;
}

/// The model that the schema describes, with its errors as those of the schema's file.
const wire::DescribedModel& model_of(const ImportSchema& schema, const std::string& file) {
  try {
    return dynamic_cast<const wire::DescribedModel&>(wire::recorded_model(
        {.version = schema.name + "-imported", .description = schema.description.dump()}));
  } catch (const wire::ModelProgramError& error) {
    const std::string_view text = error.what();
    constexpr std::string_view before = "description: ";
    const std::size_t begin = text.find(before);
    throw DefinitionError(fmt::format(
        "{}: {}", file, begin == text.npos ? text : text.substr(begin + before.size())));
  }
}

/// The lines of the file as columns of numbers; NaN is what is none.
class ResultColumns {
 public:
  ResultColumns(std::string_view text, const std::string& name) : reader_(text, name) {
    if (!reader_.next_row()) reader_.refuse("the file is empty; its first line must hold headings");
    headings_.assign(reader_.cells().begin(), reader_.cells().end());
  }

  /// @return The column's place among values().
  std::size_t add(const std::string& heading, bool may_be_missing) {
    columns_.push_back({reader_.position_of(heading), may_be_missing});
    return columns_.size() - 1;
  }

  void read(const IsStopped& is_stopped) {
    values_.resize(columns_.size());
    while (reader_.next_row()) {
      if (is_stopped()) throw Interrupted();
      reader_.expect_cells(headings_.size());
      for (std::size_t i = 0; i < columns_.size(); ++i) values_[i].push_back(number(columns_[i]));
    }
    if (num_rows() == 0) reader_.refuse("no line after that of the headings");
  }

  [[nodiscard]] const std::vector<double>& values(std::size_t column) const {
    return values_[column];
  }
  [[nodiscard]] std::size_t num_rows() const { return values_.front().size(); }

 private:
  struct Column {
    std::size_t position;
    bool may_be_missing;
  };

  [[nodiscard]] double number(const Column& column) const {
    static constexpr std::string_view others[] = {"", "nan", "inf", "-inf", "null"};
    std::string cell(reader_.cells()[column.position]);
    std::ranges::transform(cell, cell.begin(), [](unsigned char c) { return std::tolower(c); });
    if (column.may_be_missing && std::ranges::find(others, cell) != std::end(others)) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    const std::string& heading = headings_[column.position];
    const double value = reader_.number(column.position, heading);
    if (column.may_be_missing || is_in_range(value)) return value;
    reader_.refuse(fmt::format("{} = {} (must be in [-{:g}, {:g}])", heading, value, magnitude_max,
                               magnitude_max));
  }

  CsvReader reader_;
  std::vector<std::string> headings_;
  std::vector<Column> columns_;
  std::vector<std::vector<double>> values_;
};

/// Makes the result of each run of the columns.
class ImportedRuns {
 public:
  ImportedRuns(const ImportSchema& schema, ResultColumns& columns) : columns_(columns) {
    for (const QuantityColumns& quantity : schema.quantities) {
      truths_.push_back(columns.add(quantity.truth, false));
      estimates_.push_back(columns.add(quantity.estimate, true));
      if (quantity.standard_error.empty()) continue;
      errors_.push_back(columns.add(quantity.standard_error, true));
    }
  }

  [[nodiscard]] RunResult result_of(std::size_t run) const {
    RunResult result{.run = RunIndex{run}, .num_draws = 1, .truth = row(truths_, run)};
    std::vector<double> estimate = row(estimates_, run), errors = row(errors_, run);
    if (std::ranges::none_of(estimate, is_in_range)) {
      result.status = RunStatus::lost;
      result.loss = {.cause = 1, .session = 1};
    } else if (!std::ranges::all_of(estimate, is_in_range) ||
               !std::ranges::all_of(errors, [](double e) { return is_in_range(e) && e >= 0.0; })) {
      result.status = RunStatus::not_finite;
    } else {
      result.num_rounds = 1;
      result.estimate = std::move(estimate);
      // Standard errors are taken as those of independent estimates.
      if (!errors.empty()) result.correlations.assign(errors.size() * (errors.size() - 1) / 2, 0.0);
      result.standard_error = std::move(errors);
    }
    return result;
  }

 private:
  [[nodiscard]] std::vector<double> row(const std::vector<std::size_t>& columns,
                                        std::size_t run) const {
    std::vector<double> values;
    for (const std::size_t column : columns) values.push_back(columns_.values(column)[run]);
    return values;
  }

  const ResultColumns& columns_;
  std::vector<std::size_t> truths_, estimates_, errors_;
};

/// The campaign whose draws are columns of the file.
wire::DescribedCampaign campaign_of(const wire::DescribedModel& model, const ImportSchema& schema,
                                    const ResultColumns& columns,
                                    const std::vector<std::size_t>& drawn) {
  wire::DescribedCampaign campaign(model);
  campaign.name = schema.name;
  campaign.num_runs = columns.num_rows();
  for (const std::size_t column : drawn) campaign.table_columns.push_back(columns.values(column));
  return campaign;
}

/// What a schema says that the campaign does not allow.
void check(const wire::DescribedCampaign& campaign, const std::string& file) {
  try {
    campaign.validate();
    check_independence(campaign.law_set(), campaign);
  } catch (const ConfigError& error) {
    // All columns have the one key of the schema.
    constexpr std::string_view key = ".independent";
    const std::string& field = error.field();
    const std::string text = std::string(error.what()).substr(field.size());
    throw DefinitionError(
        fmt::format("{}: {}{}", file, field.ends_with(key) ? "campaign.independent" : field, text));
  }
}

constexpr wire::SessionId importer{1};

/// All that the database has from the beginning, some at a time.
class ImportEntries {
 public:
  ImportEntries(const ImportedRuns& runs, std::uint64_t num_runs, IsStopped is_stopped)
      : runs_(runs), num_runs_(num_runs), is_stopped_(std::move(is_stopped)) {}

  std::vector<Entry> next() {
    if (is_stopped_()) throw Interrupted();
    constexpr std::uint64_t batch_size = 10'000;
    if (next_run_ == num_runs_) return {};
    std::vector<Entry> entries;
    if (next_run_ == 0) {
      entries.push_back(WorkerJoined{.session = importer,
                                     .name = "import",
                                     .host = wire::host_name(),
                                     .process_id = static_cast<std::uint64_t>(getpid())});
    }
    const std::uint64_t end = std::min(num_runs_, next_run_ + batch_size);
    for (; next_run_ < end; ++next_run_) {
      entries.push_back(
          Delivery{.result = runs_.result_of(next_run_), .worker = importer, .attempt = {1}});
    }
    if (next_run_ == num_runs_) {
      entries.push_back(WorkerEnded{.session = importer, .reason = wire::LossReason::drained});
      entries.push_back(CampaignControl{.phase = wire::CampaignPhase::finished});
    }
    return entries;
  }

 private:
  const ImportedRuns& runs_;
  std::uint64_t num_runs_;
  std::uint64_t next_run_ = 0;
  IsStopped is_stopped_;
};

std::string text_of(const std::filesystem::path& file, std::size_t size_max) {
  try {
    return detail::read_text_file(file, size_max, detail::Pipes::accepted);
  } catch (const detail::UnreadableFile& error) {
    throw DefinitionError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace

void import_results(const std::filesystem::path& results, const std::filesystem::path& schema_file,
                    const std::filesystem::path& database, const IsStopped& is_stopped) {
  Document document(schema_file.string(), detail::read_toml_text(schema_file, schema_size_max), {});
  const ImportSchema schema = read_schema(document, results.filename().string());
  const wire::DescribedModel& model = model_of(schema, schema_file.string());
  const std::string text = text_of(results, results_size_max);
  const std::string results_name = results.string();
  ResultColumns columns(text, results_name);
  const ImportedRuns runs(schema, columns);
  std::vector<std::size_t> drawn;
  for (const wire::ProgramDraw& draw : model.parts().drawn) {
    drawn.push_back(columns.add(draw.law.column, false));
  }
  columns.read(is_stopped);
  const wire::DescribedCampaign campaign = campaign_of(model, schema, columns, drawn);
  check(campaign, schema_file.string());
  ImportEntries entries(runs, campaign.num_runs, is_stopped);
  Store store = Store::create(database, campaign, campaign.definition(TableColumns::left_out).text,
                              [&] { return entries.next(); });
  update_statistics(store, campaign);
}

}  // namespace proofmass::coordinator
