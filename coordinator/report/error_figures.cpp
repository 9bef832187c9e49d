#include "coordinator/report/error_figures.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_worst_shown = 5;
constexpr std::size_t num_convergence_points = 40;
constexpr std::uint64_t first_convergence_count = 5;

}  // namespace

void keep_largest(const RunValue& candidate, std::size_t count, std::vector<RunValue>& largest) {
  if (largest.size() == count && candidate.value <= largest.back().value) return;
  const auto place =
      std::ranges::upper_bound(largest, candidate.value, std::greater<>(), &RunValue::value);
  largest.insert(place, candidate);
  if (largest.size() > count) largest.pop_back();
}

std::vector<std::uint64_t> convergence_counts(std::uint64_t num_runs) {
  std::vector<std::uint64_t> counts;
  if (num_runs == 0) return counts;
  const double ratio = static_cast<double>(num_runs) / static_cast<double>(first_convergence_count);
  for (std::size_t i = 0; i < num_convergence_points && num_runs > first_convergence_count; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(num_convergence_points);
    const auto count = static_cast<std::uint64_t>(
        std::round(static_cast<double>(first_convergence_count) * std::pow(ratio, part)));
    if (counts.empty() || counts.back() < count) counts.push_back(count);
  }
  if (counts.empty() || counts.back() < num_runs) counts.push_back(num_runs);
  return counts;
}

ErrorFigures::ErrorFigures(std::size_t num_quantities, std::uint64_t num_runs)
    : counts_(convergence_counts(num_runs)), quantities_(num_quantities) {}

void ErrorFigures::add_error(RunIndex run, double error, Growing& quantity) {
  const double magnitude = std::abs(error);
  quantity.magnitudes.add(magnitude);
  quantity.errors.add(error);
  keep_largest({.run = run, .value = magnitude}, num_worst_shown, quantity.figures.worst);
  if (!quantity.sums) quantity.sums.emplace(magnitude);
  quantity.sums->add(magnitude);
}

void ErrorFigures::add_convergence() {
  for (Growing& quantity : quantities_) {
    const Moments moments = quantity.sums->moments();
    quantity.figures.convergence.push_back(
        {.num_runs = num_estimated_,
         .worst = quantity.figures.worst.front().value,
         .mean = moments.mean,
         .mean_interval = mean_interval(moments, default_confidence),
         .standard_deviation = moments.standard_deviation,
         .deviation_interval = deviation_interval(moments, default_confidence)});
  }
}

void ErrorFigures::add(const RunResult& result) {
  if (!result.is_completed()) return;
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    add_error(result.run, result.error(i), quantities_[i]);
  }
  ++num_estimated_;
  if (next_count_ >= counts_.size() || num_estimated_ < counts_[next_count_]) return;
  ++next_count_;
  add_convergence();
}

void leave_out_intervals(QuantityFigures& figures) {
  for (ConvergencePoint& point : figures.convergence) {
    point.mean_interval.reset();
    point.deviation_interval.reset();
  }
}

std::vector<QuantityFigures> ErrorFigures::figures() {
  // Where runs have no estimate, the last count is not reached.
  const bool has_last = next_count_ > 0 && counts_[next_count_ - 1] == num_estimated_;
  if (num_estimated_ > 0 && !has_last) add_convergence();
  std::vector<QuantityFigures> figures;
  for (Growing& quantity : quantities_) {
    quantity.figures.magnitudes = quantity.magnitudes.histogram();
    quantity.figures.errors = quantity.errors.histogram();
    figures.push_back(std::move(quantity.figures));
  }
  return figures;
}

}  // namespace proofmass::coordinator
