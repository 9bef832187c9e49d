#include "core/campaign/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "core/error.hpp"
#include "core/statistics/bootstrap.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass {
namespace {

std::vector<double> magnitudes_of(std::span<const double> errors) {
  std::vector<double> magnitudes(errors.size());
  std::ranges::transform(errors, magnitudes.begin(), [](double error) { return std::abs(error); });
  return magnitudes;
}

std::array<PercentileStatistic, percentile_levels.size()> percentiles_of(
    std::span<const double> magnitudes) {
  const std::vector<double> ascending = sorted(magnitudes);
  std::array<PercentileStatistic, percentile_levels.size()> percentiles;
  for (std::size_t i = 0; i < percentile_levels.size(); ++i) {
    const double level = percentile_levels[i];
    percentiles[i] = {.level = level,
                      .value = percentile(ascending, level),
                      .interval = percentile_interval(ascending, level, default_confidence)};
  }
  return percentiles;
}

}  // namespace

std::optional<Interval> CampaignStatistics::within_objectives(std::uint64_t num_given_up) const {
  const std::uint64_t num_draws = num_runs + num_given_up;
  if (num_draws == 0) return std::nullopt;
  return probability_interval(static_cast<double>(num_within_objectives),
                              static_cast<double>(num_draws), default_confidence);
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

void StatisticsAccumulator::add(const RunResult& result) {
  PROOFMASS_EXPECT(!last_run_ || *last_run_ < result.run);
  last_run_ = result.run;
  ++counts_.num_runs;
  if (result.status == RunStatus::not_converged) ++counts_.num_not_converged;
  if (result.status == RunStatus::not_finite) ++counts_.num_not_finite;
  if (result.status == RunStatus::no_draw) ++counts_.num_no_draw;
  if (result.status == RunStatus::lost) ++counts_.num_lost;
  if (!result.has_estimate()) return;

  ++counts_.num_estimated;
  estimated_runs_.push_back(result.run);
  bool is_within = true;
  for (std::size_t i = 0; i < errors_.size(); ++i) {
    errors_[i].push_back(result.error(i));
    if (std::abs(errors_[i].back()) > objectives_[i]) is_within = false;
  }
  if (is_within) ++counts_.num_within_objectives;
}

CampaignStatistics StatisticsAccumulator::statistics() const {
  CampaignStatistics statistics = counts_;
  statistics.accuracy.resize(errors_.size());
  if (estimated_runs_.empty()) return statistics;
  for (std::size_t i = 0; i < errors_.size(); ++i) statistics.accuracy[i] = accuracy(i);
  return statistics;
}

AccuracyStatistic StatisticsAccumulator::accuracy(std::size_t quantity) const {
  const std::vector<double> magnitudes = magnitudes_of(errors_[quantity]);
  const Extreme worst = extremes(magnitudes).largest;
  const double objective = objectives_[quantity];
  const auto num_beyond =
      std::ranges::count_if(magnitudes, [&](double error) { return error > objective; });
  const Moments about = moments(magnitudes);
  return {.worst = worst.value,
          .worst_run = estimated_runs_[worst.index],
          .mean = about.mean,
          .standard_deviation = about.standard_deviation,
          .num_beyond_objective = static_cast<std::uint64_t>(num_beyond),
          .beyond_objective =
              probability_interval(static_cast<double>(num_beyond),
                                   static_cast<double>(magnitudes.size()), default_confidence),
          .mean_interval = mean_interval(about, default_confidence),
          .deviation_interval = bootstrap_deviation_interval(magnitudes, default_confidence),
          .percentiles = percentiles_of(magnitudes),
          .error = error_statistic(moments(errors_[quantity]))};
}

}  // namespace proofmass
