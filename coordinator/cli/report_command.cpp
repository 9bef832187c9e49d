#include "coordinator/cli/report_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_start.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/requirement_text.hpp"
#include "coordinator/report/sensitivity_text.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/model.hpp"
#include "core/definition/nearest_name.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass::coordinator {
namespace {

std::vector<RequirementAnswer> answers_of(const Store& store,
                                          const std::vector<std::string>& requirements) {
  try {
    return check_requirements(store, stored_campaign(store)->objectives(), requirements);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

int print_requirements(const Store& store, const std::vector<std::string>& requirements) {
  bool are_met = true;
  std::string_view separator = "";
  for (const RequirementAnswer& answer : answers_of(store, requirements)) {
    print_lines(fmt::format("{}{}", separator, requirement_text(answer)));
    separator = "\n";
    are_met = are_met && answer.check.verdict == Verdict::met;
  }
  return are_met ? exit_done : exit_not_met;
}

std::size_t quantity_named(std::string_view name) {
  const ResultSchema& schema = model().results();
  if (const std::optional<std::size_t> found = find_quantity(schema, name)) return *found;
  throw UsageError(fmt::format("parameter = {} (must be one of {})", name,
                               fmt::join(quantity_names(schema), " ")));
}

}  // namespace

int print_report(const ReportOptions& options) {
  const Store store = Store::open_read_only(options.database);
  if (!options.requirements.empty()) return print_requirements(store, options.requirements);
  print_lines(report_text(store, *stored_campaign(store)));
  return exit_done;
}

int print_sensitivity(const SensitivityOptions& options) {
  std::vector<std::size_t> quantities;
  if (options.parameter) quantities.push_back(quantity_named(*options.parameter));
  const Store store = Store::open_read_only(options.database);
  std::optional<RunIndex> explained;
  if (options.run) explained = RunIndex{*options.run};
  const DrawnRuns drawn =
      read_drawn_runs(store, *stored_campaign(store), sensitivity_runs_max, explained);
  if (drawn.runs.size() < sensitivity_values_min) {
    throw Error(fmt::format("runs with an estimate = {} (sensitivities need {} at least)",
                            drawn.runs.size(), sensitivity_values_min));
  }
  if (explained) {
    const std::size_t quantity =
        quantities.empty() ? worst_quantity_of(drawn, *explained) : quantities.front();
    print_lines(explanation_text(drawn, quantity, *explained, options.num_rows));
    return exit_done;
  }
  if (quantities.empty()) {
    for (std::size_t i = 0; i < drawn.errors.size(); ++i) quantities.push_back(i);
  }
  std::string_view separator = "";
  for (const std::size_t quantity : quantities) {
    print_lines(
        fmt::format("{}{}", separator, sensitivity_text(drawn, quantity, options.num_rows)));
    separator = "\n";
  }
  return exit_done;
}

}  // namespace proofmass::coordinator
