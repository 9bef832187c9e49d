#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "coordinator/charts/ticks.hpp"
#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/table/figures.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_named_max = 8;

/// `a, b and 3 more`.
std::string list_of(const std::vector<std::string>& names) {
  const std::size_t num_named = std::min(names.size(), num_named_max);
  std::string list = fmt::format("{}", fmt::join(std::span(names).first(num_named), ", "));
  if (names.size() > num_named) list += fmt::format(" and {} more", names.size() - num_named);
  return list;
}

/// What results are counted in: realisations share a draw.
std::string_view unit_of(const Review& review) {
  return review.results.instruments ? "runs" : "draws";
}

std::string_view be(std::uint64_t count) { return count == 1 ? "is" : "are"; }

std::string question(const Review& review) {
  if (!review.why_not_independent.empty()) {
    return "No requirement can be judged by this campaign.";
  }
  if (review.matrix.empty()) {
    return "No requirement was given and no parameter has an objective: nothing was asked.";
  }
  std::vector<std::string> names;
  for (const RequirementAnswer& row : review.matrix) {
    if (!is_default(row)) names.push_back(requirement_name(row));
  }
  if (names.empty()) {
    return fmt::format(
        "It was asked whether {} of all draws meet the objective of each parameter, and all "
        "objectives together, each with {} confidence, which is the default of the program and no "
        "demand of a project.",
        given_percent(default_tolerance.coverage), given_percent(default_tolerance.confidence));
  }
  return fmt::format("It was asked whether {} {}: {}{}.", names.size(),
                     names.size() == 1 ? "requirement holds" : "requirements hold", list_of(names),
                     names.size() < review.matrix.size() ? ", and all objectives together" : "");
}

std::string draws(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  const std::uint64_t num_wanted = review.num_runs;
  const std::uint64_t num_done = statistics.num_runs + review.results.missing.num_given_up;
  const std::uint64_t num_missing = num_done - statistics.num_estimated;
  std::string text = num_done < num_wanted
                         ? fmt::format("The campaign is not finished: {} of {} {} {} done",
                                       num_done, num_wanted, unit_of(review), be(num_done))
                         : fmt::format("{}{} {} {} done", num_wanted == 1 ? "1 of " : "All ",
                                       num_wanted, unit_of(review), be(num_wanted));
  if (num_missing > 0) {
    text += fmt::format(", {} of them without an estimate ({}), which {} as {}", num_missing,
                        reasons_text(review.results.missing), num_missing == 1 ? "counts" : "count",
                        num_missing == 1 ? "an exceedance" : "exceedances");
  }
  return text + ".";
}

std::string verdicts(const Review& review) {
  if (!review.why_not_independent.empty()) {
    return fmt::format("There is no verdict: {}.", review.why_not_independent);
  }
  if (review.matrix.empty()) return "There is no verdict.";
  std::vector<std::string> parts;
  for (const RequirementVerdict verdict :
       {RequirementVerdict::met, RequirementVerdict::not_met, RequirementVerdict::undecided}) {
    std::vector<std::string> names;
    for (const RequirementAnswer& row : review.matrix) {
      if (row.check.verdict == verdict) names.push_back(requirement_name(row));
    }
    if (names.empty()) continue;
    parts.push_back(fmt::format("{} {} {}", names.size(), be(names.size()), name_of(verdict)));
    if (verdict != RequirementVerdict::met) parts.back() += fmt::format(" ({})", list_of(names));
  }
  return fmt::format("Of {}, {}.", counted(review.matrix.size(), "requirement"),
                     fmt::join(parts, ", "));
}

/// The quantity whose worst error is the largest beside its objective.
std::optional<std::size_t> worst_quantity(const Review& review) {
  std::optional<std::size_t> worst;
  const auto ratio = [&](std::size_t i) {
    return review.results.statistics.accuracy[i].worst / review.objectives[i];
  };
  for (std::size_t i = 0; i < review.objectives.size(); ++i) {
    if (std::isfinite(review.objectives[i]) && (!worst || ratio(i) > ratio(*worst))) worst = i;
  }
  return worst;
}

std::string driver_of(const Review& review, std::size_t quantity) {
  if (!review.why_not_independent.empty()) {
    return "what drives it is not sought, as that needs independent draws";
  }
  const std::optional<Causes>& causes = review.causes;
  if (!causes) return "what drives it is not known, as fewer than 16 draws have an estimate";
  const auto term = std::ranges::find(causes->terms, quantity, &CauseTerm::quantity);
  if (term == causes->terms.end()) {
    return fmt::format(
        "in {} draws no drawn quantity or product of two was found to explain it; whether any "
        "changes its size, `proofmass sensitivity` tells",
        causes->num_runs);
  }
  return fmt::format("of the variance of this error over the draws, {} % goes with {}",
                     figure_text(100.0 * term->found.share), term->name);
}

SummarySentence worst_error(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  if (statistics.num_estimated == 0) {
    return {"No draw has an estimate, so that there is no worst error.", "Accuracy"};
  }
  const std::optional<std::size_t> worst = worst_quantity(review);
  if (!worst) return {"No parameter has an objective to hold its worst error against.", "Accuracy"};
  const Quantity& quantity = review.schema.quantities[*worst];
  const AccuracyStatistic& accuracy = statistics.accuracy[*worst];
  return {fmt::format("The worst error is that of {} in run {}, {} or {} of its objective; {}.",
                      quantity.symbol, accuracy.worst_run.value,
                      quantity_text(accuracy.worst, quantity),
                      figure_text(100.0 * accuracy.worst / review.objectives[*worst]) + " %",
                      driver_of(review, *worst)),
          review.causes && !review.causes->terms.empty() ? "Causes of the errors" : "Accuracy"};
}

SummarySentence consequence(const Review& review) {
  if (!review.budget) return {"The model has no budget that the errors would enter.", "Accuracy"};
  // `Budget of the test of ..., m/s²`.
  const std::string_view title = review.budget->title;
  const std::string budget = fmt::format("b{}", title.substr(1, title.find(',') - 1));
  const BudgetColumns columns = budget_columns(*review.budget, review.results.statistics);
  const std::string before = figure_text(columns.before.total);
  const std::optional<RunTotals>& totals = review.results.totals;
  if (!totals) {
    return {
        fmt::format("The {} is {} m/s² before calibration; what is left after it cannot be told "
                    "without an estimate.",
                    budget, before),
        "Budget"};
  }
  const CampaignStatistics& statistics = review.results.statistics;
  const bool is_of_all = statistics.num_estimated == statistics.num_runs;
  const std::string those =
      is_of_all ? std::string(unit_of(review))
                : fmt::format("{} {} with an estimate", statistics.num_estimated, unit_of(review));
  return {fmt::format("Calibration takes the {} from {} m/s² to at most {} m/s² in half of the "
                      "{}, {} m/s² in 95 % of them, and {} m/s² in the worst, run {}.",
                      budget, before, figure_text(totals->median), those,
                      figure_text(totals->percentile_95), figure_text(totals->worst),
                      totals->worst_run.value),
          "Budget"};
}

}  // namespace

std::vector<SummarySentence> review_summary(const Review& review) {
  return {{question(review), "Verification matrix"},
          {draws(review), "How it was run"},
          {verdicts(review), "Verification matrix"},
          worst_error(review),
          consequence(review)};
}

}  // namespace proofmass::coordinator
