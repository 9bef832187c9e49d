#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "core/model.hpp"
#include "core/result_rules.hpp"

namespace proofmass::coordinator {
namespace {

StopCheck check_exceedances(const StopRule& rule, const Store& store,
                            std::span<const double> objectives, std::uint64_t num_runs) {
  Exceedances exceedances(rule.requirement, objectives);
  ResultReader reader = store.results({RunIndex{0}, num_runs});
  while (const std::optional<RunResult> result = reader.next()) {
    if (result->is_completed()) exceedances.add(*result);
  }
  return check_stop_rule(rule, exceedances.of(num_runs), store.num_runs_fixed());
}

/// The rule against the runs [0, num_runs): errors of those that have an estimate, or how many of
/// all exceed something.
StopCheck check_with(const StopRule& rule, const Store& store, std::span<const double> objectives,
                     std::uint64_t num_runs) {
  if (is_about_exceedances(rule)) return check_exceedances(rule, store, objectives, num_runs);
  std::vector<double> errors;
  store.for_each_error(rule.parameter, num_runs,
                       [&](double error) { errors.push_back(std::abs(error)); });
  return check_stop_rule(rule, errors);
}

/// The one with the most runs.
std::optional<StopCheckRow> last_check(const Store& store, const StopPlan& plan) {
  std::optional<StopCheckRow> last;
  for (const StopCheckRow& row : store.stop_checks()) {
    if (row.statistic == statistic_of(plan.stop_rule)) last = row;
  }
  return last;
}

}  // namespace

std::optional<std::uint64_t> summarise_file(
    const std::filesystem::path& file, const Campaign& campaign,
    const std::function<void(const std::function<void(Store&)>&)>& write) {
  const Store reader = Store::open_read_only(file);
  std::optional<ReadResults> results;
  StopPlan plan;
  StopRule rule;
  std::optional<StopCheck> check;
  std::uint64_t num_runs = 0;
  reader.read_one_state([&] {
    results = read_results(reader, campaign);
    plan = reader.stop_plan();
    num_runs = reader.num_runs();
    const std::uint64_t num_settled = results->statistics.num_runs + results->missing.num_given_up;
    if (plan.stop_rule.empty() || num_settled < num_runs) return;
    rule = parse_stop_rule(plan.stop_rule, reader.schema());
    check = check_with(rule, reader, campaign.objectives(), num_runs);
  });
  if (!check) {
    write([&](Store& store) { write_statistics(store, campaign, *results); });
    return std::nullopt;
  }
  write([&](Store& store) {
    write_statistics(store, campaign, *results);
    store.record_stop_check(num_runs, statistic_of(plan.stop_rule), *check);
  });
  const std::uint64_t num_runs_max = plan.num_runs_max.value_or(num_runs);
  if (check->is_reached || num_runs >= num_runs_max) return std::nullopt;
  return std::min(next_stop_check(num_runs), num_runs_max);
}

namespace {

/// A rule of the statistic that a row is of; empty if there is no such statistic.
std::optional<StopRule> rule_of(const StopCheckRow& row, const ResultSchema& schema) {
  const bool is_whole = std::string_view(row.statistic).ends_with("decided");
  try {
    return parse_stop_rule(is_whole ? row.statistic : row.statistic + " within 5%", schema);
  } catch (const ConfigError&) {
    return std::nullopt;
  }
}

// A plan may be changed: the rule of an older row may have asked for any width below 100 %.
bool was_reached(const StopCheck& check, bool stored) {
  if (!check.relative_half_width || *check.relative_half_width >= 1.0) return false;
  return *check.relative_half_width == 0.0 || stored;
}

StopCheckRow recomputed(const StopCheckRow& row, const StopRule& rule, const Store& store,
                        std::span<const double> objectives) {
  StopCheckRow must = row;
  must.check = check_with(rule, store, objectives, row.num_runs);
  // A verdict depends on nothing that the row does not name.
  if (rule.statistic != StopRule::Statistic::verdict) {
    must.check.is_reached = was_reached(must.check, row.check.is_reached);
  }
  return must;
}

/// The check that ended a campaign; empty if it has not ended, or has no rule.
std::optional<StopCheckRow> deciding_check(const Store& store, std::span<const double> objectives) {
  const std::string text = store.stop_plan().stop_rule;
  if (text.empty() || store.control().phase != wire::CampaignPhase::finished) return std::nullopt;
  const StopRule rule = parse_stop_rule(text, store.schema());
  const std::uint64_t num_runs = store.num_runs();
  const StopCheck check = check_with(rule, store, objectives, num_runs);
  if (check.is_too_skewed) return std::nullopt;  // Older programs may have called it reached.
  return StopCheckRow{
      .statistic = std::string(statistic_of(text)), .num_runs = num_runs, .check = check};
}

/// Runs [0, n) that are finished, and were before any stop check of as many runs: none of them was
/// ever given up, to be finished later.
std::uint64_t num_held(const Store& store) {
  const std::vector<RunRange> finished = store.finished_runs();
  if (finished.empty() || finished.front().first.value != 0) return 0;
  return std::min(finished.front().count, store.num_before_blame());
}

}  // namespace

std::vector<std::string> stop_check_differences(const Store& store,
                                                std::span<const double> objectives) {
  std::vector<std::string> differences;
  // Older models counted the errors of runs that did not converge.
  if (store.model_version() != store.model().version()) return differences;
  std::vector<StopCheckRow> expected;
  const std::uint64_t num_runs = store.num_runs();
  const std::uint64_t num_runs_held = num_held(store);
  for (const StopCheckRow& row : store.stop_checks()) {
    const std::optional<StopRule> rule = rule_of(row, store.schema());
    if (!rule) {
      differences.push_back(
          fmt::format("stop_check.statistic = {} (must be that of a stop rule)", row.statistic));
    } else if (row.num_runs > num_runs) {
      differences.push_back(fmt::format("stop_check.num_runs of {} = {} (must be at most {})",
                                        row.statistic, row.num_runs, num_runs));
    } else if (row.num_runs <= num_runs_held) {
      expected.push_back(recomputed(row, *rule, store, objectives));
    }
  }
  // Comes last: of two expected rows of one check, this one holds.
  if (num_runs <= num_runs_held) {
    if (const auto deciding = deciding_check(store, objectives)) expected.push_back(*deciding);
  }
  std::ranges::copy(store.stop_check_differences(expected), std::back_inserter(differences));
  return differences;
}

namespace {

RequirementVerdict verdict_of(const StopRule& rule, const StopCheck& check) {
  if (!check.is_reached) return RequirementVerdict::undecided;
  const double allowed_rate = 1.0 - rule.requirement.tolerance.coverage;
  return check.estimate < allowed_rate ? RequirementVerdict::met : RequirementVerdict::not_met;
}

std::string verdict_text(const StopRule& rule, const StopCheckRow& row) {
  const StopCheck& check = row.check;
  Interval bounds = check.interval.value_or(Interval{.lower = 0.0, .upper = 1.0});
  bounds.confidence =
      rule.requirement.tolerance.confidence;  // Stored with the rule and not with the bounds.
  const RequirementVerdict verdict = verdict_of(rule, check);
  // As report --requirement has it: runs in which all objectives hold, or those beyond the limit.
  const bool is_joint = rule.requirement.subject == Requirement::Subject::all_objectives;
  const double fraction = is_joint ? 1.0 - check.estimate : check.estimate;
  return fmt::format("          {} after {} runs; {}: {:.0f}\n          {}\n", name_of(verdict),
                     row.num_runs, is_joint ? "holding" : "exceeding",
                     fraction * static_cast<double>(row.num_runs),
                     bounds_text(rule.requirement, bounds, verdict));
}

std::string width_text(const StopRule& rule, const StopCheckRow& row) {
  const StopCheck& check = row.check;
  std::string text = check.relative_half_width
                         ? fmt::format("within {:.3g} %, half its 95 % interval",
                                       100.0 * *check.relative_half_width)
                         : std::string("without an interval");
  if (rule.statistic != StopRule::Statistic::success || !check.interval) return text + "\n";
  return text +
         fmt::format("\n          in {:.0f} of {} runs, {} of all draws",
                     check.estimate * static_cast<double>(row.num_runs), row.num_runs,
                     interval_percent(*check.interval)) +
         "\n";
}

}  // namespace

std::optional<StopOutcome> stop_outcome(const Store& store) {
  const StopPlan plan = store.stop_plan();
  if (plan.stop_rule.empty()) return std::nullopt;
  StopOutcome outcome{.rule = plan.stop_rule, .check = last_check(store, plan), .is_missed = true};
  if (!outcome.check) return outcome;
  const StopRule rule = parse_stop_rule(plan.stop_rule, store.schema());
  const StopCheckRow& row = *outcome.check;
  bool holds = row.check.is_reached;
  if (rule.statistic == StopRule::Statistic::verdict) {
    const RequirementVerdict verdict = verdict_of(rule, row.check);
    holds = verdict == RequirementVerdict::met;
    outcome.answer = name_of(verdict);
    outcome.text = fmt::format("Stopping  {}\n{}", outcome.rule, verdict_text(rule, row));
  } else {
    const std::optional<double>& width = row.check.relative_half_width;
    // A check in between may be of another rule about this statistic.
    const bool is_last =
        row.num_runs == store.num_runs() && store.control().phase == wire::CampaignPhase::finished;
    const bool is_too_skewed = is_last && !holds && width && *width <= rule.relative_half_width;
    outcome.answer = holds ? "reached" : "not reached";
    outcome.text = fmt::format(
        "Stopping  {} {}          after {} runs; {}: {}{}\n", statistic_of(outcome.rule),
        width_text(rule, row), row.num_runs, outcome.rule, outcome.answer,
        is_too_skewed ? ", the errors being too skewed for this interval" : "");
  }
  outcome.is_missed = !holds || row.num_runs < store.num_runs();
  return outcome;
}

bool lacks_stop_check(const Store& store) {
  const std::optional<StopOutcome> outcome = stop_outcome(store);
  return outcome && (!outcome->check || outcome->check->num_runs < store.num_runs());
}

bool is_rule_missed(const Store& store) {
  const std::optional<StopOutcome> outcome = stop_outcome(store);
  return outcome && outcome->is_missed;
}

}  // namespace proofmass::coordinator
