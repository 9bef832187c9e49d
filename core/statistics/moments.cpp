#include "core/statistics/moments.hpp"

#include <algorithm>
#include <cmath>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {
namespace {

/// Sums of x², d, d² and d³ with d = x − centre.
struct PowerSums {
  CompensatedSum raw_squares, differences, squares, cubes;
};

PowerSums power_sums(std::span<const double> values, double centre) {
  PowerSums sums;
  for (const double value : values) {
    const double difference = value - centre;
    const double square = difference * difference;
    sums.raw_squares.add(value * value);
    sums.differences.add(difference);
    sums.squares.add(square);
    sums.cubes.add(square * difference);
  }
  return sums;
}

// G1 from central sums: Σ(x − mean)² and Σ(x − mean)³.
double adjusted_skewness(double n, double squares, double cubes) {
  if (n < 3.0 || squares <= 0.0) return 0.0;
  const double deviation = std::sqrt(squares / n);
  const double plain = cubes / n / (deviation * deviation * deviation);
  return std::sqrt(n * (n - 1.0)) / (n - 2.0) * plain;
}

}  // namespace

Moments moments(std::span<const double> values) {
  detail::check_values("values", values, 1);
  const auto n = static_cast<double>(values.size());
  const double centre = compensated_sum(values) / n;
  const PowerSums sums = power_sums(values, centre);
  const double offset = sums.differences.value() / n;
  const double raw = sums.squares.value();
  const double squares = std::max(raw - n * offset * offset, 0.0);
  const double cubes = sums.cubes.value() - 3.0 * offset * raw + 2.0 * n * offset * offset * offset;
  return {.count = values.size(),
          .mean = centre + offset,
          .standard_deviation = values.size() < 2 ? 0.0 : std::sqrt(squares / (n - 1.0)),
          .rms = std::sqrt(sums.raw_squares.value() / n),
          .skewness = adjusted_skewness(n, squares, cubes)};
}

}  // namespace proofmass
