#include "core/statistics/moments.hpp"

#include <algorithm>
#include <cmath>

#include "core/statistics/detail/check.hpp"

namespace proofmass {
namespace {

// G1 from central sums: Σ(x − mean)² and Σ(x − mean)³.
double adjusted_skewness(double n, double squares, double cubes) {
  if (n < 3.0 || squares <= 0.0) return 0.0;
  const double deviation = std::sqrt(squares / n);
  const double plain = cubes / n / (deviation * deviation * deviation);
  return std::sqrt(n * (n - 1.0)) / (n - 2.0) * plain;
}

// G2 from central sums: Σ(x − mean)² and Σ(x − mean)⁴.
double adjusted_kurtosis(double n, double squares, double fourths) {
  const double plain = n * (fourths / squares) / squares;
  if (n < 4.0 || !(plain >= 1.0) || !std::isfinite(plain)) return 0.0;  // No law is below 1.
  return (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * (plain - 3.0) + 6.0);
}

}  // namespace

void MomentSums::add(double value) {
  const double difference = value - centre_;
  const double square = difference * difference;
  ++count_;
  raw_squares_.add(value * value);
  differences_.add(difference);
  squares_.add(square);
  cubes_.add(square * difference);
  fourths_.add(square * square);
}

Moments MomentSums::moments() const {
  const auto n = static_cast<double>(count_);
  const double offset = differences_.value() / n;
  const double raw = squares_.value();
  const double squares = std::max(raw - n * offset * offset, 0.0);
  const double cubes = cubes_.value() - 3.0 * offset * raw + 2.0 * n * offset * offset * offset;
  const double fourths = fourths_.value() - 4.0 * offset * cubes_.value() +
                         6.0 * offset * offset * raw - 3.0 * n * offset * offset * offset * offset;
  return {.count = count_,
          .mean = centre_ + offset,
          .standard_deviation = count_ < 2 ? 0.0 : std::sqrt(squares / (n - 1.0)),
          .rms = std::sqrt(raw_squares_.value() / n),
          .skewness = adjusted_skewness(n, squares, cubes),
          .excess_kurtosis = adjusted_kurtosis(n, squares, fourths)};
}

Moments moments(std::span<const double> values) {
  detail::check_values("values", values, 1);
  MomentSums sums(compensated_sum(values) / static_cast<double>(values.size()));
  for (const double value : values) sums.add(value);
  return sums.moments();
}

}  // namespace proofmass
