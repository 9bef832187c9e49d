#include "core/campaign/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
namespace {

/// What follows from moments and extremes; without percentiles.
AccuracyStatistic accuracy_of(const ErrorExtremes& extremes, const Moments& magnitudes,
                              const Moments& errors) {
  return {.worst = extremes.worst.value_or(0.0),
          .worst_run = extremes.worst_run,
          .mean = magnitudes.mean,
          .standard_deviation = magnitudes.standard_deviation,
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

ErrorStatistic error_statistic(const Moments& about) {
  return {.bias = about.mean,
          .bias_interval = mean_interval(about, default_confidence),
          .rms = about.rms,
          .standard_deviation = about.standard_deviation,
          .deviation_interval = deviation_interval(about, default_confidence),
          .skewness = about.skewness};
}

std::vector<double> CampaignStatistics::worst_errors() const {
  std::vector<double> errors;
  for (const AccuracyStatistic& of_quantity : accuracy) errors.push_back(of_quantity.worst);
  return errors;
}

std::vector<double> CampaignStatistics::mean_errors() const {
  std::vector<double> errors;
  for (const AccuracyStatistic& of_quantity : accuracy) errors.push_back(of_quantity.mean);
  return errors;
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
  if (!statistics.health.empty()) level = statistics.health.at(budget.level);
  BudgetColumns columns{.before = budget.before(level.mean), .after_worst = {}, .after_mean = {}};
  if (statistics.num_estimated > 0) {
    columns.after_worst = budget.after(statistics.worst_errors(), level.worst);
    columns.after_mean = budget.after(statistics.mean_errors(), level.mean);
  }
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
  statistics.accuracy.resize(objectives_.size());
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    const Quantity& quantity = quantities_[i];
    statistics.accuracy[i] =
        accuracy_of(quantity.extremes, quantity.magnitudes.moments(), quantity.errors.moments());
  }
  return statistics;
}

StatisticsPasses::StatisticsPasses(std::vector<double> objectives, std::size_t num_kept_max)
    : objectives_(std::move(objectives)) {
  const ValuePasses::Wanted of_magnitudes{
      .levels = {percentile_levels.begin(), percentile_levels.end()},
      .has_deviation_interval = true};
  for (std::size_t i = 0; i < objectives_.size(); ++i) {
    quantities_.push_back({.errors = ValuePasses({}, num_kept_max),
                           .magnitudes = ValuePasses(of_magnitudes, num_kept_max),
                           .extremes = {}});
  }
}

void StatisticsPasses::add(const RunResult& result) {
  PROOFMASS_EXPECT(!last_run_ || *last_run_ < result.run);
  last_run_ = result.run;
  if (is_first_pass_) counts_.count(result);
  if (!result.is_completed()) return;
  if (is_first_pass_ && !result.health.empty()) {
    ++num_with_health_;
    health_.resize(result.health.size());
    for (std::size_t i = 0; i < health_.size(); ++i) {
      health_[i].first = std::max(health_[i].first, result.health[i]);
      health_[i].second.add(result.health[i]);
    }
  }
  bool is_within = true;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    QuantityPasses& quantity = quantities_[i];
    const double error = result.error(i);
    const double magnitude = std::abs(error);
    quantity.errors.add(error);
    quantity.magnitudes.add(magnitude);
    if (!is_first_pass_) continue;
    if (!quantity.extremes.add(result.run, magnitude, objectives_[i])) is_within = false;
  }
  if (is_first_pass_ && is_within) ++counts_.num_within_objectives;
}

bool StatisticsPasses::end_pass() {
  is_first_pass_ = false;
  last_run_.reset();
  bool is_another_needed = false;
  for (QuantityPasses& quantity : quantities_) {
    if (quantity.errors.end_pass()) is_another_needed = true;
    if (quantity.magnitudes.end_pass()) is_another_needed = true;
  }
  return is_another_needed;
}

CampaignStatistics StatisticsPasses::statistics() const {
  CampaignStatistics statistics = counts_;
  for (const auto& [worst, sum] : health_) {
    statistics.health.push_back({worst, sum.value() / static_cast<double>(num_with_health_)});
  }
  statistics.accuracy.resize(quantities_.size());
  if (counts_.num_estimated == 0) return statistics;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    statistics.accuracy[i] = accuracy(quantities_[i]);
  }
  return statistics;
}

AccuracyStatistic StatisticsPasses::accuracy(const QuantityPasses& quantity) const {
  AccuracyStatistic accuracy =
      accuracy_of(quantity.extremes, quantity.magnitudes.moments(), quantity.errors.moments());
  accuracy.deviation_interval = quantity.magnitudes.deviation_interval();
  for (std::size_t i = 0; i < percentile_levels.size(); ++i) {
    const double level = percentile_levels[i];
    accuracy.percentiles[i] = {.level = level,
                               .value = quantity.magnitudes.percentile(level),
                               .interval = quantity.magnitudes.percentile_interval(level)};
  }
  return accuracy;
}

}  // namespace proofmass
