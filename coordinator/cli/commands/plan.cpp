#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "coordinator/table/figures.hpp"
#include "core/campaign/allocation.hpp"
#include "core/campaign/plan_study.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

struct PlanOptions {
  std::filesystem::path file;
  Overrides overrides;
  std::filesystem::path new_file;  ///< That an allocation is written to; empty: none is made.
  std::optional<int> num_steps;    ///< To be allocated; by default as many as the file has.
  int minimum = 4;                 ///< Of each session.
  std::string goal = "objectives";
  OutputFormat format = OutputFormat::text;
};

/// The sessions of a campaign with some lengths, and what they find out.
struct Planned {
  std::vector<std::string> sessions;
  std::vector<int> num_steps;
  int num_steps_in_all;
  PlanBound bound;
  std::vector<double> objectives;
  std::size_t num_instruments;
  std::string method;
};

Planned planned(const Campaign& campaign, const PlanStudy& study, std::vector<int> num_steps) {
  const int in_all = std::accumulate(num_steps.begin(), num_steps.end(), 0);
  PlanBound bound = study.bound(num_steps);
  return {study.session_names(), std::move(num_steps),    in_all,        std::move(bound),
          campaign.objectives(), study.num_instruments(), study.method()};
}

/// `99.988`: a probability of 1 − miss in percent, with two digits of what is missing.
std::string percent_text(double miss) {
  if (miss < 1e-12) return "100";
  const int decimals = static_cast<int>(std::ceil(-std::log10(miss))) - 1;
  return fmt::format("{:.{}f}", 100.0 * (1.0 - miss), std::clamp(decimals, 1, 10));
}

Table bound_table(const Planned& plan) {
  Table table{.columns = {{.title = "parameter", .is_text = true},
                          {.title = "unit", .is_text = true},
                          {.title = "objective"},
                          {.title = "σ"},
                          {.title = "objective/σ"},
                          {.title = "holds, %"}}};
  const std::vector<Quantity>& quantities = model().results().quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const auto& [objective, sigma] = std::pair(plan.objectives[i], plan.bound.standard_errors[i]);
    const double scale = quantities[i].display_scale;
    table.rows.push_back({quantities[i].symbol, quantities[i].display_unit,
                          given_figure(objective / scale), measured_figure(sigma / scale),
                          measured_figure(objective / sigma), percent_text(plan.bound.misses[i])});
  }
  table.remarks.push_back({fmt::format("all objectives hold in {} % of the runs",
                                       percent_text(plan.bound.misses_any))});
  if (plan.bound.mean_budget) {
    table.remarks.push_back(
        {fmt::format("budget: {} m/s² in the mean", measured_figure(*plan.bound.mean_budget))});
  }
  table.notes.push_back(fmt::format(
      "σ: standard error of estimates by the method {}, mean of {} instruments; the errors of runs "
      "are taken to be normal, and no run to be lost",
      plan.method, plan.num_instruments));
  return table;
}

Table session_table(const Planned& plan) {
  Table table{.columns = {{.title = "session", .is_text = true},
                          {.title = std::string(model().step_name())}},
              .has_total = true};
  for (std::size_t i = 0; i < plan.sessions.size(); ++i) {
    table.rows.push_back({plan.sessions[i], fmt::to_string(plan.num_steps[i])});
  }
  table.rows.push_back({"all", fmt::to_string(plan.num_steps_in_all)});
  return table;
}

void print_plan(const PlanOptions& options, const Planned& plan) {
  if (options.format == OutputFormat::text) {
    const TerminalStyle style = style_of(stdout);
    write_standard_output(terminal_text(bound_table(plan), style));
    write_standard_output("\n" + terminal_text(session_table(plan), style));
    return;
  }
  using Json = nlohmann::ordered_json;
  Json json{{"file", options.file.string()},
            {"method", plan.method},
            {"num_steps", plan.num_steps_in_all},
            {"step_name", model().step_name()},
            {"num_instruments", plan.num_instruments},
            {"misses_any", plan.bound.misses_any},
            {"mean_budget", nullptr},
            {"parameters", Json::array()},
            {"sessions", Json::array()}};
  if (plan.bound.mean_budget) json["mean_budget"] = *plan.bound.mean_budget;
  const std::vector<Quantity>& quantities = model().results().quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    json["parameters"].push_back({{"parameter", quantities[i].name},
                                  {"unit", quantities[i].unit},
                                  {"objective", plan.objectives[i]},
                                  {"standard_error", plan.bound.standard_errors[i]},
                                  {"misses", plan.bound.misses[i]}});
  }
  for (std::size_t i = 0; i < plan.sessions.size(); ++i) {
    json["sessions"].push_back({{"session", plan.sessions[i]}, {"num_steps", plan.num_steps[i]}});
  }
  print_json(json);
}

std::unique_ptr<PlanStudy> study_of(const PlanOptions& options, const Campaign& campaign) {
  try {
    std::unique_ptr<PlanStudy> study = model().study(campaign);
    if (study != nullptr) return study;
  } catch (const ConfigError& error) {
    throw UsageError(fmt::format("{}: {}", options.file.string(), error.what()));
  }
  throw UsageError(fmt::format("{}: campaigns of this model have no bound", options.file.string()));
}

/// The lengths of the sessions with which the goal is reached best.
std::vector<int> allocated(const PlanOptions& options, const PlanStudy& study) {
  const std::vector<int> of_file = study.num_steps();
  const int in_all = options.num_steps.value_or(std::accumulate(of_file.begin(), of_file.end(), 0));
  const auto least = static_cast<std::size_t>(options.minimum) * of_file.size();
  if (static_cast<std::size_t>(in_all) < least) {
    throw UsageError(fmt::format("--{} = {} (must be {} or more, --minimum {} for each of {})",
                                 model().step_name(), in_all, least, options.minimum,
                                 of_file.size()));
  }
  const bool is_for_budget = options.goal == "budget";
  if (is_for_budget && !study.bound(of_file).mean_budget) {
    throw UsageError("--for = budget (the campaign has no budget of errors)");
  }
  return allocate(of_file.size(), {.num_steps = in_all, .minimum = options.minimum},
                  [&](std::span<const int> num_steps) {
                    const PlanBound bound = study.bound(num_steps);
                    if (is_for_budget) return -bound.mean_budget.value_or(0.0);
                    return (1.0 - bound.misses_any) / bound.misses_any;  // Exact at both ends.
                  });
}

int plan_campaign(const PlanOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  if (!options.new_file.empty()) check_new_file("--optimise", options.new_file);
  const std::unique_ptr<const PlanStudy> study = study_of(options, *campaign);
  if (options.new_file.empty()) {
    print_plan(options, planned(*campaign, *study, study->num_steps()));
    return exit_done;
  }
  const Planned plan = planned(*campaign, *study, allocated(options, *study));
  try {
    write_document(options.new_file, wire::IfThere::keep, study->campaign_file(plan.num_steps));
  } catch (const ConfigError& error) {
    throw UsageError(
        fmt::format("no campaign file can hold the best allocation: {}; choose another "
                    "--{} or --minimum",
                    error.what(), model().step_name()));
  }
  print_plan(options, plan);
  if (options.format == OutputFormat::text) {
    print_lines(fmt::format("wrote {}\n", options.new_file.string()));
  }
  return exit_done;
}

}  // namespace

void add_plan(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<PlanOptions>(
      app, chosen, "plan", "Predict the errors of a campaign, or plan it", plan_campaign);
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
  CLI::Option* const optimise = command.add_option(
      "--optimise", options.new_file,
      "Allocate the time to the sessions as is best, and\nwrite the new campaign file");
  optimise->type_name(campaign_file_type);
  const std::string steps(model().step_name());
  command
      .add_option("--" + steps, options.num_steps,
                  "Number to allocate; by default that of the file")
      ->check(wire::in_range(1, 1'000'000))
      ->needs(optimise);
  command.add_option("--minimum", options.minimum, "Least number of a session")
      ->needs(optimise)
      ->check(wire::in_range(1, 10'000))
      ->capture_default_str();
  command
      .add_option("--for", options.goal,
                  "What is to be best: the chance that all objectives\nhold, or the mean budget")
      ->check(CLI::IsMember({"objectives", "budget"}))
      ->needs(optimise)
      ->capture_default_str();
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
