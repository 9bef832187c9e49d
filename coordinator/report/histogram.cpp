#include "coordinator/report/histogram.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace proofmass::coordinator {
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
