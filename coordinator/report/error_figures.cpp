#include "coordinator/report/error_figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "coordinator/report/histogram.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_worst_shown = 5;
constexpr std::size_t num_convergence_points = 40;
constexpr std::uint64_t few_convergence_runs = 5;

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
  // Of few runs all: one point is no line.
  const double first =
      num_runs > few_convergence_runs ? static_cast<double>(few_convergence_runs) : 1.0;
  const double ratio = static_cast<double>(num_runs) / first;
  for (std::size_t i = 0; i < num_convergence_points; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(num_convergence_points);
    const auto count = static_cast<std::uint64_t>(std::round(first * std::pow(ratio, part)));
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

namespace {

// Of magnitudes: what is smaller than 1e-120, zeros too, is in the first bin.
constexpr int bins_a_decade = 10;
constexpr int first_decade = -120;
constexpr int last_decade = 92;
constexpr std::size_t num_magnitude_bins =
    static_cast<std::size_t>(last_decade - first_decade) * bins_a_decade;

double magnitude_edge(std::size_t bin) {
  const int tenths = first_decade * bins_a_decade + static_cast<int>(bin);
  return std::pow(10.0, static_cast<double>(tenths) / bins_a_decade);
}

// Of errors.
constexpr std::size_t num_error_bins = 64;
constexpr std::size_t middle = num_error_bins / 2;
constexpr int smallest_exponent = -400;

}  // namespace

MagnitudeBins::MagnitudeBins() : counts_(num_magnitude_bins) {}

void MagnitudeBins::add(double value) {
  ++num_values_;
  double position = 0.0;
  if (value > 0.0) position = std::floor((std::log10(value) - first_decade) * bins_a_decade);
  position = std::clamp(position, 0.0, static_cast<double>(num_magnitude_bins - 1));
  ++counts_[static_cast<std::size_t>(position)];
}

Histogram MagnitudeBins::histogram() const {
  Histogram histogram;
  if (num_values_ == 0) return histogram;
  std::size_t first = 0;
  while (histogram.num_below + counts_[first] <= num_values_ / 100) {
    histogram.num_below += counts_[first++];
  }
  std::size_t last = num_magnitude_bins - 1;
  while (last > first && counts_[last] == 0) --last;
  for (std::size_t bin = first; bin <= last; ++bin) {
    histogram.edges.push_back(magnitude_edge(bin));
    histogram.counts.push_back(counts_[bin]);
  }
  histogram.edges.push_back(magnitude_edge(last + 1));
  return histogram;
}

ErrorBins::ErrorBins() : exponent_(smallest_exponent), counts_(num_error_bins) {}

void ErrorBins::double_width() {
  std::vector<std::uint64_t> merged(num_error_bins);
  for (std::size_t bin = 0; bin < num_error_bins; ++bin) {
    // Bins are counted from the middle: [0, 1) and [1, 2) become [0, 2).
    merged[(bin + middle) / 2] += counts_[bin];
  }
  counts_ = std::move(merged);
  ++exponent_;
}

void ErrorBins::add(double value) {
  const auto bin_of = [&] { return std::floor(std::ldexp(value, -exponent_)); };
  constexpr auto end = static_cast<double>(middle);
  while (bin_of() < -end || bin_of() >= end) double_width();
  ++counts_[static_cast<std::size_t>(bin_of() + end)];
}

Histogram ErrorBins::histogram() const {
  const auto has_values = [](std::uint64_t count) { return count > 0; };
  const auto first = std::ranges::find_if(counts_, has_values);
  if (first == counts_.end()) return {};
  const auto last = std::find_if(counts_.rbegin(), counts_.rend(), has_values).base();
  Histogram histogram{.edges = {}, .counts = {first, last}, .num_below = 0};
  const auto edge = [&](auto place) {
    return std::ldexp(static_cast<double>(place - counts_.begin()) - static_cast<double>(middle),
                      exponent_);
  };
  for (auto place = first; place != last; ++place) histogram.edges.push_back(edge(place));
  histogram.edges.push_back(edge(last));
  return histogram;
}

}  // namespace proofmass::coordinator
