#include "core/statistics/sensitivity.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/report/sensitivity.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/independence.hpp"
#include "core/runs.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

/// More than any model draws and estimates.
constexpr std::size_t num_rows_max = 2000;

struct SensitivityOptions {
  std::filesystem::path database;
  std::optional<std::string> parameter;  ///< Name; all by default.
  std::optional<std::uint64_t> run;      ///< To be explained.
  std::optional<std::size_t> num_rows;   ///< Drawn quantities that are named for each error.
  OutputFormat format = OutputFormat::text;
  ClientConnectionConfig connection;  ///< Of a coordinator, if it is to be asked.
};

std::size_t quantity_named(std::string_view name, const ResultSchema& schema) {
  if (const std::optional<std::size_t> found = find_quantity(schema, name)) return *found;
  throw UsageError(fmt::format("parameter = {} (must be one of {})", name,
                               fmt::join(quantity_names(schema), " ")));
}

int print_remote_sensitivity(const SensitivityOptions& options) {
  proto::RequestEnvelope question = question_about(options.database, proto::QUESTION_SENSITIVITY);
  proto::AnswerRequest& asked = *question.mutable_answer();
  if (options.num_rows) asked.add_options(fmt::format("--rows={}", *options.num_rows));
  if (options.parameter) asked.add_options("--parameter=" + *options.parameter);
  if (options.run) asked.add_options(fmt::format("--run={}", *options.run));
  if (options.format == OutputFormat::json) asked.add_options("--json");
  return print_answer(options.connection, question, AnswerText::lines);
}

int print_sensitivity(const SensitivityOptions& options) {
  if (is_remote(options.connection, options.database)) return print_remote_sensitivity(options);
  const Store store = Store::open_read_only(options.database);
  std::vector<std::size_t> quantities;
  if (options.parameter) quantities.push_back(quantity_named(*options.parameter, store.schema()));
  std::optional<RunIndex> explained;
  if (options.run) explained = RunIndex{*options.run};
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  require_independent(*campaign, "campaign", campaign->name);
  const DrawnRuns drawn = read_drawn_runs(store, *campaign, sensitivity_runs_max, explained);
  if (drawn.runs.size() < sensitivity_values_min) {
    throw Error(fmt::format("runs with an estimate = {} (sensitivities need {} at least)",
                            drawn.runs.size(), sensitivity_values_min));
  }
  const bool is_json = options.format == OutputFormat::json;
  if (explained && quantities.empty()) {
    const std::vector<double> objectives = campaign->objectives();
    if (!is_json) print_lines(choice_text(drawn, *explained, objectives));
    quantities.push_back(worst_quantity_of(drawn, *explained, objectives));
  }
  if (quantities.empty()) {
    for (std::size_t i = 0; i < drawn.errors.size(); ++i) quantities.push_back(i);
  }
  if (is_json) {
    print_json(sensitivity_json(drawn, quantities, explained, options.num_rows));
    return exit_done;
  }
  const Paint paint = style_of(stdout).paint;
  std::string_view separator = "";
  std::vector<std::size_t> unexplained;
  const auto write = [&](const std::string& text) {
    write_standard_output(fmt::format("{}{}", separator, text));
    separator = "\n";
  };
  for (const std::size_t quantity : quantities) {
    const std::string text = sensitivity_text(drawn, quantity, explained, options.num_rows, paint);
    if (text.empty()) {
      unexplained.push_back(quantity);
    } else {
      write(text);
    }
  }
  if (!unexplained.empty()) write(unexplained_text(drawn, unexplained));
  return exit_done;
}

}  // namespace

void add_sensitivity(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<SensitivityOptions>(
      app, chosen, "sensitivity", "Print which drawn quantities drive the errors",
      print_sensitivity);
  add_database(command, options.database);
  command.add_option("--parameter", options.parameter,
                     "Parameter; all by default, or with --run the one\n"
                     "with the largest error beside its objective");
  command.add_option("--run", options.run, "Explain the error of this run")
      ->check(wire::in_range(std::uint64_t{0}, num_runs_max - 1));
  command
      .add_option("--rows", options.num_rows,
                  "Quantities to name for each error; by default 5,\n"
                  "or none if chance explains all influences")
      ->check(wire::in_range(std::size_t{1}, num_rows_max));
  add_json_flag(command, options.format);
  add_optional_connection(command, options.connection);
}

}  // namespace proofmass::coordinator
