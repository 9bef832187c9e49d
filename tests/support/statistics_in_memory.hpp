#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/campaign/statistics.hpp"
#include "core/statistics/bootstrap.hpp"
#include "core/statistics/moments.hpp"
#include "core/statistics/order.hpp"

namespace proofmass::test {

/// The statistics of StatisticsPasses computed a second way: all errors are kept, sorted and handed
/// to the functions of core/statistics at once.
class StatisticsInMemory {
 public:
  explicit StatisticsInMemory(std::vector<double> objectives)
      : objectives_(std::move(objectives)), errors_(objectives_.size()) {}

  void add(const RunResult& result) {
    ++counts_.num_runs;
    if (result.status == RunStatus::not_converged) ++counts_.num_not_converged;
    if (result.status == RunStatus::not_finite) ++counts_.num_not_finite;
    if (result.status == RunStatus::no_draw) ++counts_.num_no_draw;
    if (result.status == RunStatus::lost) ++counts_.num_lost;
    if (!result.is_completed()) return;

    ++counts_.num_estimated;
    estimated_runs_.push_back(result.run);
    bool is_within = true;
    for (std::size_t i = 0; i < errors_.size(); ++i) {
      errors_[i].push_back(result.error(i));
      if (std::abs(errors_[i].back()) > objectives_[i]) is_within = false;
    }
    if (is_within) ++counts_.num_within_objectives;
  }

  [[nodiscard]] CampaignStatistics statistics() const {
    CampaignStatistics statistics = counts_;
    statistics.accuracy.resize(errors_.size());
    if (estimated_runs_.empty()) return statistics;
    for (std::size_t i = 0; i < errors_.size(); ++i) statistics.accuracy[i] = accuracy(i);
    return statistics;
  }

 private:
  static std::vector<double> magnitudes_of(std::span<const double> errors) {
    std::vector<double> magnitudes(errors.size());
    std::ranges::transform(errors, magnitudes.begin(),
                           [](double error) { return std::abs(error); });
    return magnitudes;
  }

  static std::array<PercentileStatistic, percentile_levels.size()> percentiles_of(
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

  [[nodiscard]] AccuracyStatistic accuracy(std::size_t quantity) const {
    const std::vector<double> magnitudes = magnitudes_of(errors_[quantity]);
    const auto worst = std::ranges::max_element(magnitudes);
    const double objective = objectives_[quantity];
    const auto num_beyond =
        std::ranges::count_if(magnitudes, [&](double error) { return error > objective; });
    const Moments about = moments(magnitudes);
    return {.worst = *worst,
            .worst_run = estimated_runs_[static_cast<std::size_t>(worst - magnitudes.begin())],
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

  std::vector<double> objectives_;
  CampaignStatistics counts_;
  std::vector<RunIndex> estimated_runs_;
  std::vector<std::vector<double>> errors_;
};

}  // namespace proofmass::test
