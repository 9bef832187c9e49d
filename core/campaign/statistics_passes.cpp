#include "core/campaign/statistics_passes.hpp"

#include <cmath>

#include "core/error.hpp"

namespace proofmass {

StatisticsPasses::StatisticsPasses(const ParameterArray& objectives, std::size_t num_kept_max)
    : objectives_(objectives) {
  const ValuePasses::Wanted of_magnitudes{
      .levels = {percentile_levels.begin(), percentile_levels.end()},
      .has_deviation_interval = true};
  for (std::size_t i = 0; i < num_parameters; ++i) {
    parameters_.push_back({.errors = ValuePasses({}, num_kept_max),
                           .magnitudes = ValuePasses(of_magnitudes, num_kept_max),
                           .worst_run = {}});
  }
}

void StatisticsPasses::add(const RunResult& result) {
  PROOFMASS_EXPECT(!last_run_ || *last_run_ < result.run);
  last_run_ = result.run;
  if (is_first_pass_) count(result);
  if (!result.has_estimate()) return;
  bool is_within = true;
  for (const ParameterInfo& info : parameter_infos()) {
    const std::size_t i = index(info.parameter);
    ParameterPasses& parameter = parameters_[i];
    const double error = result.error(info.parameter);
    const double magnitude = std::abs(error);
    parameter.errors.add(error);
    parameter.magnitudes.add(magnitude);
    if (!is_first_pass_) continue;
    if (counts_.num_estimated == 1 || magnitude > parameter.worst) {
      parameter.worst = magnitude;
      parameter.worst_run = result.run;
    }
    if (magnitude <= objectives_[i]) continue;
    ++parameter.num_beyond;
    is_within = false;
  }
  if (is_first_pass_ && is_within) ++counts_.num_within_objectives;
}

void StatisticsPasses::count(const RunResult& result) {
  ++counts_.num_runs;
  if (result.status == RunStatus::not_converged) ++counts_.num_not_converged;
  if (result.status == RunStatus::not_finite) ++counts_.num_not_finite;
  if (result.status == RunStatus::no_draw) ++counts_.num_no_draw;
  if (result.status == RunStatus::lost) ++counts_.num_lost;
  if (result.has_estimate()) ++counts_.num_estimated;
}

bool StatisticsPasses::end_pass() {
  is_first_pass_ = false;
  last_run_.reset();
  bool is_another_needed = false;
  for (ParameterPasses& parameter : parameters_) {
    if (parameter.errors.end_pass()) is_another_needed = true;
    if (parameter.magnitudes.end_pass()) is_another_needed = true;
  }
  return is_another_needed;
}

CampaignStatistics StatisticsPasses::statistics() const {
  CampaignStatistics statistics = counts_;
  if (counts_.num_estimated == 0) return statistics;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    statistics.accuracy[i] = accuracy(parameters_[i]);
  }
  return statistics;
}

AccuracyStatistic StatisticsPasses::accuracy(const ParameterPasses& parameter) const {
  const Moments& about = parameter.magnitudes.moments();
  AccuracyStatistic accuracy{.worst = parameter.worst,
                             .worst_run = parameter.worst_run,
                             .mean = about.mean,
                             .standard_deviation = about.standard_deviation,
                             .num_beyond_objective = parameter.num_beyond,
                             .beyond_objective = probability_interval(
                                 static_cast<double>(parameter.num_beyond),
                                 static_cast<double>(counts_.num_estimated), default_confidence),
                             .mean_interval = mean_interval(about, default_confidence),
                             .deviation_interval = parameter.magnitudes.deviation_interval(),
                             .error = error_statistic(parameter.errors.moments())};
  for (std::size_t i = 0; i < percentile_levels.size(); ++i) {
    const double level = percentile_levels[i];
    accuracy.percentiles[i] = {.level = level,
                               .value = parameter.magnitudes.percentile(level),
                               .interval = parameter.magnitudes.percentile_interval(level)};
  }
  return accuracy;
}

}  // namespace proofmass
