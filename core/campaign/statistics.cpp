#include "core/campaign/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/error.hpp"

namespace proofmass {
namespace {

double mean_of(const std::vector<double>& values) {
  CompensatedSum sum;
  for (const double value : values) sum.add(value);
  return sum.value() / static_cast<double>(values.size());
}

// The difference to the mean is taken before squaring: a spread far below the mean survives.
double standard_deviation_of(const std::vector<double>& values, double mean) {
  if (values.size() < 2) return 0.0;
  CompensatedSum squares;
  for (const double value : values) squares.add((value - mean) * (value - mean));
  return std::sqrt(squares.value() / static_cast<double>(values.size() - 1));
}

}  // namespace

void CompensatedSum::add(double term) {
  const double sum = sum_ + term;
  const bool term_is_small = std::abs(sum_) >= std::abs(term);
  lost_ += term_is_small ? (sum_ - sum) + term : (term - sum) + sum_;
  sum_ = sum;
}

ParameterArray CampaignStatistics::worst_errors() const {
  ParameterArray errors{};
  for (std::size_t i = 0; i < num_parameters; ++i) errors[i] = accuracy[i].worst;
  return errors;
}

ParameterArray CampaignStatistics::mean_errors() const {
  ParameterArray errors{};
  for (std::size_t i = 0; i < num_parameters; ++i) errors[i] = accuracy[i].mean;
  return errors;
}

void StatisticsAccumulator::add(const RunResult& result) {
  PROOFMASS_EXPECT(!last_run_ || *last_run_ < result.run);
  last_run_ = result.run;
  ++counts_.num_runs;
  if (result.status == RunStatus::not_converged) ++counts_.num_not_converged;
  if (result.status == RunStatus::not_finite) ++counts_.num_not_finite;
  if (result.status == RunStatus::no_draw) ++counts_.num_no_draw;
  if (!result.has_estimate()) return;

  ++counts_.num_estimated;
  estimated_runs_.push_back(result.run);
  for (const ParameterInfo& info : parameter_infos()) {
    errors_[index(info.parameter)].push_back(std::abs(result.error(info.parameter)));
  }
}

CampaignStatistics StatisticsAccumulator::statistics() const {
  CampaignStatistics statistics = counts_;
  if (estimated_runs_.empty()) return statistics;
  for (const ParameterInfo& info : parameter_infos()) {
    statistics.accuracy[index(info.parameter)] = accuracy(info.parameter);
  }
  return statistics;
}

AccuracyStatistic StatisticsAccumulator::accuracy(Parameter parameter) const {
  const std::vector<double>& errors = errors_[index(parameter)];
  const auto worst = std::max_element(errors.begin(), errors.end());
  const double objective = objectives_[index(parameter)];
  const auto num_beyond =
      std::count_if(errors.begin(), errors.end(), [&](double error) { return error > objective; });
  const double mean = mean_of(errors);
  return {.worst = *worst,
          .worst_run = estimated_runs_[static_cast<std::size_t>(worst - errors.begin())],
          .mean = mean,
          .standard_deviation = standard_deviation_of(errors, mean),
          .num_beyond_objective = static_cast<std::uint64_t>(num_beyond)};
}

}  // namespace proofmass
