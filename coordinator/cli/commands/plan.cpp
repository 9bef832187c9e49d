#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/table/table.hpp"
#include "core/campaign/allocation.hpp"
#include "core/campaign/plan_study.hpp"
#include "core/model.hpp"
#include "proto/text/visible_text.hpp"

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
  const PlanStudy& study;
  std::vector<int> num_steps;  ///< Of each session.
  PlanBound bound;
  std::vector<Quantity> quantities;
  std::vector<double> objectives;
  std::vector<std::string> others;        ///< Symbols of what has an objective and no bound.
  std::vector<std::string> budget_notes;  ///< Of a campaign with a budget.
  std::string note;                       ///< Campaign::note().

  [[nodiscard]] int num_steps_in_all() const {
    return std::accumulate(num_steps.begin(), num_steps.end(), 0);
  }
};

/// `99.988`: a probability of 1 − miss in percent, with two digits of what is missing, and seven in
/// all: further ones would be about tails of an assumed law beyond five standard errors.
std::string percent_text(double miss) {
  if (miss < 5e-8) return "100";
  const int decimals = static_cast<int>(std::ceil(-std::log10(miss))) - 1;
  return fmt::format("{:.{}f}", 100.0 * (1.0 - miss), std::clamp(decimals, 1, 5));
}

/// What the mean budget takes for its level, and what else `report` says of the budget.
std::vector<std::string> budget_notes_of(const Campaign& campaign, const PlanScope& scope) {
  const std::optional<ErrorBudget> budget = campaign.error_budget();
  if (!budget) return {};
  const std::string told =
      scope.probed_level == 0.0 ? "" : fmt::format("the probed runs: {:.3g}", scope.probed_level);
  return level_notes(*budget, campaign.results().health.at(budget->level).unit, told);
}

Planned planned(const Campaign& campaign, const PlanStudy& study, std::vector<int> num_steps) {
  PlanBound bound = study.bound(num_steps);
  // Sessions beside those of the study may add further ones.
  std::vector<Quantity> quantities = campaign.results().quantities;
  std::vector<double> objectives = campaign.objectives();
  std::vector<std::string> others;
  for (std::size_t i = bound.misses.size(); i < objectives.size(); ++i) {
    if (std::isfinite(objectives[i])) others.emplace_back(quantities[i].symbol);
  }
  quantities.resize(bound.misses.size());
  objectives.resize(bound.misses.size());
  return {study,
          std::move(num_steps),
          std::move(bound),
          std::move(quantities),
          std::move(objectives),
          std::move(others),
          budget_notes_of(campaign, study.scope()),
          campaign.note()};
}

/// `all objectives hold in 97.8 % of the runs`, of those that the plan has a bound for.
std::string chance_text(const Planned& plan) {
  return fmt::format("all {} hold in {} % of the runs",
                     plan.others.empty() ? "objectives" : "of these",
                     percent_text(plan.bound.misses_any));
}

/// Empty for a campaign without a budget.
std::string budget_text(const PlanBound& bound) {
  if (!bound.mean_budget) return "";
  return fmt::format("budget: {} m/s² in the mean", measured_figure(*bound.mean_budget));
}

/// `16 of 16 probed runs are lost`.
std::string losses_text(const PlanBound& bound, std::size_t num_probed) {
  const std::size_t num_lost = bound.num_lost();
  return fmt::format("{} of {} probed runs {} lost", num_lost, num_probed,
                     num_lost == 1 ? "is" : "are");
}

void add_losses(const Planned& plan, Table& table) {
  const std::vector<PlanLoss>& losses = plan.bound.losses;
  if (losses.empty()) {
    table.notes.push_back(
        fmt::format("none of {} probed runs is lost", plan.study.scope().num_probed));
    return;
  }
  table.remarks.push_back({losses_text(plan.bound, plan.study.scope().num_probed), Tone::bad});
  for (const PlanLoss& loss : losses) {
    table.notes.push_back(fmt::format("lost, {}: {}; {}", loss.num_runs, loss.cause, loss.detail));
  }
  table.notes.push_back(
      "lost runs count as misses of every objective; remove what loses them before the campaign is "
      "run");
}

/// What may move estimates beyond the bound, in runs that are not lost.
void add_warnings(const Planned& plan, Table& table) {
  const PlanWarnings& warnings = plan.bound.warnings;
  if (warnings.num_runs == 0) return;
  table.remarks.push_back(
      {fmt::format(
           "{} of {} probed runs {} a warning: {} may move {} by up to {} of its objective, "
           "which the chances above leave out",
           warnings.num_runs, plan.study.scope().num_probed,
           warnings.num_runs == 1 ? "has" : "have", warnings.effect,
           plan.quantities[warnings.quantity].symbol, measured_figure(warnings.largest_part)),
       Tone::open});
}

void add_misfits(const PlanScope& scope, Table& table) {
  if (scope.num_misfits == 0) return;
  table.remarks.push_back(
      {fmt::format("the data of {} of {} probed runs do not fit the model of {}", scope.num_misfits,
                   scope.num_probed, scope.method),
       Tone::bad});
  table.notes.push_back(
      "where data do not fit, errors are larger than σ and the chances above are too high");
  if (scope.misfits.empty()) return;
  table.notes.push_back(fmt::format(
      "least of all fit {}: excitations that are too strong or whose lines are too close, "
      "noise of the loops, or [realism] add what the model leaves out; less of one after "
      "the other shows which",
      fmt::join(scope.misfits, ", ")));
}

/// Names the parameters whose objectives are small against what the sessions tell of them.
void add_undetermined(const Planned& plan, Table& table) {
  for (std::size_t i = 0; i < plan.objectives.size(); ++i) {
    if (plan.bound.standard_errors[i] <= plan.objectives[i]) continue;
    const std::string limit = plan.study.limit(i);
    const std::string what = limit.empty()
                                 ? plan.study.remedy(i) + " would reduce it"
                                 : "no session of this kind can see it: it is limited by " + limit;
    table.notes.push_back(
        fmt::format("σ of {} is larger than the objective; {}", plan.quantities[i].symbol, what));
  }
}

Table bound_table(const Planned& plan) {
  Table table{.columns = {{.title = "parameter", .is_text = true},
                          {.title = "unit", .is_text = true},
                          {.title = "objective"},
                          {.title = "σ"},
                          {.title = "objective/σ"},
                          {.title = "holds, %"}}};
  const std::vector<Quantity>& quantities = plan.quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const auto& [objective, sigma] = std::pair(plan.objectives[i], plan.bound.standard_errors[i]);
    const double scale = quantities[i].display_scale;
    table.rows.push_back({quantities[i].symbol, quantities[i].display_unit,
                          given_figure(objective / scale), measured_figure(sigma / scale),
                          measured_figure(objective / sigma), percent_text(plan.bound.misses[i])});
  }
  table.remarks.push_back({fmt::format("{}, if estimated by the method {}", chance_text(plan),
                                       plan.study.scope().method)});
  if (std::string budget = budget_text(plan.bound); !budget.empty()) {
    table.remarks.push_back({std::move(budget)});
  }
  table.notes.push_back(fmt::format(
      "σ: standard error of estimates by the method {}, mean of {} instruments; errors are taken "
      "to be normal, and the chance that all objectives hold is the product of the single ones; "
      "correlated errors can only raise it",
      plan.study.scope().method, plan.study.scope().num_instruments));
  table.notes.insert(table.notes.end(), plan.budget_notes.begin(), plan.budget_notes.end());
  if (!plan.others.empty()) {
    table.notes.push_back(fmt::format(
        "these objectives have no bound, and a `run` of the campaign tells how often they hold: {}",
        fmt::join(plan.others, "; ")));
  }
  add_undetermined(plan, table);
  add_losses(plan, table);
  add_warnings(plan, table);
  add_misfits(plan.study.scope(), table);
  if (!plan.note.empty()) table.notes.push_back(plan.note);
  return table;
}

Table session_table(const Planned& plan) {
  Table table{.columns = {{.title = "session", .is_text = true},
                          {.title = std::string(built_in_model().step_name())}},
              .has_total = true};
  const std::vector<std::string>& sessions = plan.study.scope().sessions;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    table.rows.push_back({sessions[i], fmt::to_string(plan.num_steps[i])});
  }
  table.rows.push_back({"all", fmt::to_string(plan.num_steps_in_all())});
  if (plan.study.scope().num_steps_beside > 0) {
    table.notes.push_back(
        fmt::format("{} {} of sessions that calibrate nothing are left as they are",
                    plan.study.scope().num_steps_beside, built_in_model().step_name()));
  }
  return table;
}

void print_plan(const PlanOptions& options, const Planned& plan) {
  if (options.format == OutputFormat::text) {
    const TerminalStyle style = style_of(stdout);
    write_standard_output(terminal_text(bound_table(plan), style));
    write_standard_output("\n" + terminal_text(session_table(plan), style));
    return;
  }
  const auto of_loss = [](const PlanLoss& loss) -> Json {
    return {{"cause", loss.cause},
            {"session", loss.session},
            {"detail", loss.detail},
            {"num_runs", loss.num_runs}};
  };
  Json json{{"file", options.file.string()},
            {"method", plan.study.scope().method},
            {"note", plan.note},
            {"num_steps", plan.num_steps_in_all()},
            {"step_name", built_in_model().step_name()},
            {"num_instruments", plan.study.scope().num_instruments},
            {"num_probed", plan.study.scope().num_probed},
            {"num_misfits", plan.study.scope().num_misfits},
            {"misfits", plan.study.scope().misfits},
            {"misses_any", plan.bound.misses_any},
            {"mean_budget", plan.bound.mean_budget},
            {"probed_level", plan.study.scope().probed_level},
            {"losses", array_of(plan.bound.losses, of_loss)},
            {"num_warned", plan.bound.warnings.num_runs},
            {"parameters", Json::array()},
            {"sessions", Json::array()}};
  const std::vector<Quantity>& quantities = plan.quantities;
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    json["parameters"].push_back({{"parameter", quantities[i].name},
                                  {"unit", quantities[i].unit},
                                  {"objective", plan.objectives[i]},
                                  {"standard_error", plan.bound.standard_errors[i]},
                                  {"misses", plan.bound.misses[i]}});
  }
  const std::vector<std::string>& sessions = plan.study.scope().sessions;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    json["sessions"].push_back({{"session", sessions[i]}, {"num_steps", plan.num_steps[i]}});
  }
  print_json(json);
}

std::unique_ptr<PlanStudy> study_of(const PlanOptions& options, const Campaign& campaign) {
  try {
    std::unique_ptr<PlanStudy> study = campaign.model().study(campaign);
    if (study != nullptr) return study;
  } catch (const ConfigError& error) {
    throw UsageError(fmt::format("{}: {}", options.file.string(), error.what()));
  }
  throw UsageError(fmt::format(
      "{}: this model does not tell the standard errors of its estimates before the runs, of which "
      "a plan is made; `run` the campaign instead",
      options.file.string()));
}

/// What is to be allocated. @throws UsageError if it cannot be, or no allocation is better.
AllocationRule checked_rule(const PlanOptions& options, const PlanStudy& study) {
  const int least_of_method = study.scope().num_steps_min;
  if (options.minimum < least_of_method) {
    throw UsageError(
        fmt::format("--minimum = {} (must be {} or more: less the transient at its beginning, a "
                    "shorter session is too short for the method {})",
                    options.minimum, least_of_method, study.scope().method));
  }
  const std::vector<int>& of_file = study.scope().num_steps;
  const int in_all = options.num_steps.value_or(std::accumulate(of_file.begin(), of_file.end(), 0));
  const AllocationRule rule{
      .num_steps = in_all, .minimum = options.minimum, .maximum = study.scope().num_steps_max};
  const auto refuse = [&](std::string_view limit, std::size_t number, std::string_view each) {
    throw UsageError(fmt::format("--{} = {} (must be {} or {}, {} for each of {} sessions)",
                                 built_in_model().step_name(), in_all, number, limit, each,
                                 of_file.size()));
  };
  const std::size_t least = static_cast<std::size_t>(rule.minimum) * of_file.size();
  const std::size_t most = static_cast<std::size_t>(rule.maximum) * of_file.size();
  const auto number = static_cast<std::size_t>(in_all);
  if (number < least && !options.num_steps) {
    throw UsageError(
        fmt::format("--minimum = {} (must be at most {}, as the file has {} {} for {} "
                    "sessions; or give --{})",
                    rule.minimum, number / of_file.size(), in_all, built_in_model().step_name(),
                    of_file.size(), built_in_model().step_name()));
  }
  if (number < least) refuse("more", least, fmt::format("--minimum {}", rule.minimum));
  if (number > most) refuse("fewer", most, fmt::format("at most {}", rule.maximum));
  const PlanBound bound = study.bound(of_file);
  if (options.goal == "budget" && !bound.mean_budget) {
    throw UsageError("--for = budget (the campaign has no budget of errors)");
  }
  if (bound.num_lost() == study.scope().num_probed) {
    throw UsageError(fmt::format(
        "{}: {} ({}); remove what loses them before time is allocated", options.file.string(),
        losses_text(bound, study.scope().num_probed), bound.losses.front().detail));
  }
  return rule;
}

/// Lost runs and misfits have an exit code of their own, because the figures are not theirs.
int exit_code_of(const Planned& plan) {
  const bool holds = plan.bound.losses.empty() && plan.study.scope().num_misfits == 0;
  return holds ? exit_done : exit_not_met;
}

/// An allocation, and whether a signal ended the search for a better one.
struct Allocated {
  std::vector<int> num_steps;
  bool is_interrupted = false;
};

Allocated allocated(const PlanOptions& options, const PlanStudy& study) {
  const AllocationRule rule = checked_rule(options, study);
  const std::size_t num_sessions = study.scope().num_steps.size();
  const PlanGoal goal = options.goal == "budget" ? PlanGoal::budget : PlanGoal::objectives;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  if (takes_escapes(stderr)) {
    wire::say(
        fmt::format("allocating {} {} to {} sessions; Ctrl-C ends with the best found so far\n",
                    rule.num_steps, built_in_model().step_name(), num_sessions));
  }
  const auto is_stopped = [&stop] { return stop != StopRequest::none; };
  const auto merit = [&](std::span<const int> num_steps) { return study.merit(goal, num_steps); };
  std::vector<int> num_steps = allocate(num_sessions, rule, merit, is_stopped);
  return {.num_steps = std::move(num_steps), .is_interrupted = is_stopped()};
}

/// Says that the new file has another method than the campaign: that of the bound.
void print_changed_method(const Campaign& campaign, const std::string& method) {
  for (const DefinitionItem& item : campaign.items()) {
    if (!item.key.ends_with(".method") || item.value == DefinitionValue(method)) continue;
    print_lines(fmt::format("changed {}: \"{}\" to \"{}\"\n", item.key,
                            std::get<std::string>(item.value), method));
  }
}

/// What the lengths in the campaign file promise, to be held beside the new ones.
void print_former_chance(const Campaign& campaign, const PlanStudy& study) {
  const Planned former = planned(campaign, study, study.scope().num_steps);
  const std::string budget = budget_text(former.bound);
  print_lines(fitted(fmt::format("before, with {} {}: {}{}{}\n", former.num_steps_in_all(),
                                 built_in_model().step_name(), chance_text(former),
                                 budget.empty() ? "" : "; ", budget)));
}

/// Names the data files that a new campaign file in another folder does not find.
void print_absent_files(const Campaign& campaign, const PlanOptions& options) {
  const std::filesystem::path folder = options.new_file.parent_path();
  std::error_code failure;
  std::vector<std::string> absent;
  for (const DefinitionItem& item : campaign.items()) {
    const auto* const file = std::get_if<std::string>(&item.value);
    if (file == nullptr || file->empty() || !item.key.ends_with(".file")) continue;
    const bool is_there = std::filesystem::exists(folder / *file, failure);
    if (!is_there && std::ranges::find(absent, *file) == absent.end()) absent.push_back(*file);
  }
  if (absent.empty()) return;
  print_lines(fmt::format("copy to its folder, as it names what is not there: {}\n",
                          fmt::join(absent, ", ")));
}

/// Writes the best allocation, or the best so far if a signal ends the search.
int optimise(const PlanOptions& options, const Campaign& campaign, const PlanStudy& study) {
  Allocated best = allocated(options, study);
  const Planned plan = planned(campaign, study, std::move(best.num_steps));
  try {
    wire::write_whole_file("--optimise", options.new_file, study.campaign_file(plan.num_steps),
                           wire::public_mode, wire::IfThere::keep);
  } catch (const ConfigError& error) {
    throw UsageError(
        fmt::format("no campaign file can hold the best allocation: {}; choose another "
                    "--{} or --minimum",
                    error.what(), built_in_model().step_name()));
  }
  print_plan(options, plan);
  if (options.format == OutputFormat::text) {
    print_former_chance(campaign, study);
    print_lines(fmt::format("wrote {}\n", options.new_file.string()));
    print_absent_files(campaign, options);
    print_changed_method(campaign, plan.study.scope().method);
  }
  if (!best.is_interrupted) return exit_code_of(plan);
  wire::say("proofmass: interrupted; this is the best allocation found so far\n");
  return exit_interrupted;
}

int plan_campaign(const PlanOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  if (!options.new_file.empty()) check_new_file("--optimise", options.new_file);
  const std::unique_ptr<const PlanStudy> study = study_of(options, *campaign);
  if (!options.new_file.empty()) return optimise(options, *campaign, *study);
  const Planned plan = planned(*campaign, *study, study->scope().num_steps);
  print_plan(options, plan);
  return exit_code_of(plan);
}

}  // namespace

void add_plan(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<PlanOptions>(
      app, chosen, "plan", "Predict the errors of a campaign, or plan it", plan_campaign);
  command.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
  CLI::Option* const optimise =
      command.add_option("--optimise", options.new_file,
                         "Allocate the time to the sessions as is best, and\nwrite the new "
                         "campaign file; Ctrl-C ends\nthe search with the best found so far");
  optimise->type_name(campaign_file_type);
  const std::string steps(built_in_model().step_name());
  add_number(command, "--" + steps, options.num_steps, {1, 1'000'000},
             "Number to allocate; by default that of the file")
      ->needs(optimise);
  add_number(command, "--minimum", options.minimum, {1, 10'000}, "Least number of a session")
      ->needs(optimise);
  command
      .add_option("--for", options.goal,
                  "What is to be best: the chance that all objectives\nhold, or the mean budget")
      ->check(CLI::IsMember({"objectives", "budget"}))
      ->needs(optimise)
      ->capture_default_str();
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
