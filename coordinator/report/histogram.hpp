#pragma once

#include <cstdint>
#include <vector>

namespace proofmass::coordinator {

/// Counts of values between edges: what a histogram shows.
struct Histogram {
  std::vector<double> edges;  ///< Ascending; one more than there are counts. None: no value.
  std::vector<std::uint64_t> counts;  ///< Of the values in [edges[i], edges[i + 1]).
  std::uint64_t num_below = 0;        ///< Values below the first edge.
};

/// Counts magnitudes, ten bins a power of ten. Memory is fixed.
class MagnitudeBins {
 public:
  MagnitudeBins();

  /// @param value  ≥ 0, at most 1e91.
  void add(double value);

  /// From the bin that at most 1 % of the values lie below to that of the largest.
  [[nodiscard]] Histogram histogram() const;

 private:
  std::uint64_t num_values_ = 0;
  std::vector<std::uint64_t> counts_;
};

/// Counts values of either sign in at most 64 bins of equal width about 0. The width is the
/// smallest power of two with which all values have a bin: it depends on the largest |value| alone,
/// not on the order.
class ErrorBins {
 public:
  ErrorBins();

  /// @param value  Between -1e91 and 1e91.
  void add(double value);

  /// From the first bin with a value to the last.
  [[nodiscard]] Histogram histogram() const;

 private:
  void double_width();

  int exponent_;  ///< Bins are 2^exponent wide.
  std::vector<std::uint64_t> counts_;
};

}  // namespace proofmass::coordinator
