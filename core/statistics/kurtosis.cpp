#include "core/statistics/kurtosis.hpp"

#include <algorithm>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/sum.hpp"

namespace proofmass {

// Central sums with d = x − c, each corrected for what the rounded mean c lacks (see moments.hpp):
// Σ(d − e)⁴ = Σd⁴ − 4 e Σd³ + 6 e² Σd² − 3 n e⁴ with e = Σd/n.
std::optional<double> excess_kurtosis(std::span<const double> values) {
  detail::check_values("values", values, 0);
  if (values.size() < 4) return std::nullopt;
  if (std::ranges::all_of(values, [&](double x) { return x == values[0]; })) return std::nullopt;
  const auto n = static_cast<double>(values.size());
  const double centre = compensated_sum(values) / n;
  CompensatedSum differences, squares, cubes, fourths;
  for (const double value : values) {
    const double difference = value - centre;
    const double square = difference * difference;
    differences.add(difference);
    squares.add(square);
    cubes.add(square * difference);
    fourths.add(square * square);
  }
  const double e = differences.value() / n;
  const double m2 = squares.value() - n * e * e;
  const double m4 = fourths.value() - 4.0 * e * cubes.value() + 6.0 * e * e * squares.value() -
                    3.0 * n * e * e * e * e;
  const double plain = n * m4 / (m2 * m2) - 3.0;
  return (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * plain + 6.0);
}

}  // namespace proofmass
