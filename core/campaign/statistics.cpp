#include "core/campaign/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
namespace {

ErrorStatistic error_statistic(const Moments& about) {
  return {.bias = about.mean,
          .bias_interval = mean_interval(about, default_confidence),
          .rms = about.rms,
          .standard_deviation = about.standard_deviation,
          .deviation_interval = deviation_interval(about, default_confidence),
          .skewness = about.skewness};
}

/// Without percentiles.
AccuracyStatistic accuracy_of(const ErrorExtremes& extremes, const Moments& magnitudes,
                              const Moments& errors) {
  return {.worst = extremes.worst.value_or(0.0),
          .worst_run = extremes.worst_run,
          .mean = magnitudes.mean,
          .standard_deviation = magnitudes.standard_deviation,
          .skewness = magnitudes.skewness,
          .num_beyond_objective = extremes.num_beyond,
          .beyond_objective =
              probability_interval(static_cast<double>(extremes.num_beyond),
                                   static_cast<double>(magnitudes.count), default_confidence),
          .mean_interval = mean_interval(magnitudes, default_confidence),
          .deviation_interval = {},
          .error = error_statistic(errors)};
}

}  // namespace

std::optional<Interval> CampaignStatistics::within_objectives(std::uint64_t num_given_up) const {
  const std::uint64_t num_draws = num_runs + num_given_up;
  if (num_draws == 0 || !are_draws_independent) return std::nullopt;
  return probability_interval(static_cast<double>(num_within_objectives),
                              static_cast<double>(num_draws), default_confidence);
}

void leave_out_intervals(CampaignStatistics& statistics) {
  statistics.are_draws_independent = false;
  for (AccuracyStatistic& accuracy : statistics.accuracy) {
    accuracy.beyond_objective = {
        .lower = 0.0, .upper = 1.0, .confidence = accuracy.beyond_objective.confidence};
    accuracy.mean_interval.reset();
    accuracy.deviation_interval.reset();
    for (PercentileStatistic& percentile : accuracy.percentiles) percentile.interval.reset();
    accuracy.error.bias_interval.reset();
    accuracy.error.deviation_interval.reset();
  }
}

void CampaignStatistics::count(const RunResult& result) {
  ++num_runs;
  if (result.status == RunStatus::not_converged) ++num_not_converged;
  if (result.status == RunStatus::not_finite) ++num_not_finite;
  if (result.status == RunStatus::no_draw) ++num_no_draw;
  if (result.status == RunStatus::lost) ++num_lost;
  if (result.is_completed()) ++num_estimated;
}

BudgetColumns budget_columns(const ErrorBudget& budget, const CampaignStatistics& statistics) {
  HealthStatistic level;
  if (budget.level < statistics.health.size()) level = statistics.health[budget.level];
  BudgetColumns columns{.before = budget.before(level.mean), .after_worst = {}, .after_mean = {}};
  if (statistics.num_estimated == 0) return columns;
  std::vector<double> worst, mean;
  for (const AccuracyStatistic& accuracy : statistics.accuracy) {
    worst.push_back(accuracy.worst);
    mean.push_back(accuracy.mean);
  }
  columns.after_worst = budget.after(worst, level.worst);
  columns.after_mean = budget.after(mean, level.mean);
  return columns;
}

bool ErrorExtremes::add(RunIndex run, double magnitude, double objective) {
  if (!worst || magnitude > *worst || (magnitude == *worst && run < worst_run)) {
    worst = magnitude;
    worst_run = run;
  }
  if (magnitude <= objective) return true;
  ++num_beyond;
  return false;
}

RunningStatistics::RunningStatistics(std::vector<double> objectives)
    : objectives_(std::move(objectives)) {}

void RunningStatistics::add(const RunResult& result) {
  counts_.count(result);
  if (!result.is_completed()) return;
  if (!result.health.empty()) {
    ++num_with_health_;
    health_.resize(result.health.size());
    for (std::size_t i = 0; i < health_.size(); ++i) {
      health_[i].first = std::max(health_[i].first, result.health[i]);
      health_[i].second.add(result.health[i]);
    }
  }
  bool is_within = true;
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    const double error = result.error(i);
    const double magnitude = std::abs(error);
    if (i == quantities_.size()) {
      quantities_.push_back({.errors = MomentSums(error), .magnitudes = MomentSums(magnitude)});
    }
    Quantity& quantity = quantities_[i];
    quantity.errors.add(error);
    quantity.magnitudes.add(magnitude);
    if (!quantity.extremes.add(result.run, magnitude, objectives_[i])) is_within = false;
  }
  if (is_within) ++counts_.num_within_objectives;
}

CampaignStatistics RunningStatistics::statistics() const {
  CampaignStatistics statistics = counts_;
  for (const auto& [worst, sum] : health_) {
    statistics.health.push_back({worst, sum.value() / static_cast<double>(num_with_health_)});
  }
  statistics.accuracy.resize(objectives_.size());
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    const Quantity& quantity = quantities_[i];
    statistics.accuracy[i] =
        accuracy_of(quantity.extremes, quantity.magnitudes.moments(), quantity.errors.moments());
  }
  return statistics;
}

void complete(AccuracyStatistic& accuracy, std::vector<double>& errors) {
  accuracy.error = error_statistic(moments(errors));
  for (double& error : errors) error = std::abs(error);
  const Moments about = moments(errors);
  accuracy.mean = about.mean;
  accuracy.standard_deviation = about.standard_deviation;
  accuracy.skewness = about.skewness;
  accuracy.mean_interval = mean_interval(about, default_confidence);
  accuracy.deviation_interval = bootstrap_deviation_interval(errors, default_confidence);
  std::ranges::sort(errors);
  for (std::size_t i = 0; i < percentile_levels.size(); ++i) {
    const double level = percentile_levels[i];
    accuracy.percentiles[i] = {.level = level,
                               .value = percentile(errors, level),
                               .interval = percentile_interval(errors, level, default_confidence)};
  }
}

}  // namespace proofmass
