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
  if (n < 4.0 || !(plain >= 1.0)) return 0.0;  // No law is below 1; one value alone leaves NaN.
  return (n - 1.0) / ((n - 2.0) * (n - 3.0)) * ((n + 1.0) * (plain - 3.0) + 6.0);
}

// Beyond it differences are scaled anew: their fourth powers must not leave the range of a double.
constexpr double scaled_max = 0x1p200;

}  // namespace

double scale_of(double value) {
  constexpr int exponent_max = 1022;  // Its inverse is a double as well.
  return value == 0.0 ? 0.0 : std::scalbn(1.0, std::min(-std::ilogb(value), exponent_max));
}

void MomentSums::add(double value) {
  const double plain = value - centre_;
  if (std::abs(plain * scale_) > scaled_max || (scale_ == 0.0 && plain != 0.0)) {
    scale_by(scale_of(plain));
  }
  const double raw = value * scale_, difference = plain * scale_;
  const double square = difference * difference;
  ++count_;
  raw_squares_.add(raw * raw);
  differences_.add(difference);
  squares_.add(square);
  cubes_.add(square * difference);
  fourths_.add(square * square);
}

void MomentSums::scale_by(double scale) {
  const double factor = scale_ == 0.0 ? 1.0 : scale / scale_;
  scale_ = scale;
  differences_.multiply(factor);
  raw_squares_.multiply(factor * factor);
  squares_.multiply(factor * factor);
  cubes_.multiply(factor * factor * factor);
  fourths_.multiply(factor * factor * factor * factor);
}

Moments MomentSums::moments() const {
  const auto n = static_cast<double>(count_);
  const double unit = scale_ == 0.0 ? 1.0 : 1.0 / scale_;
  const double offset = differences_.value() / n;
  const double raw = squares_.value();
  const double squares = std::max(raw - n * offset * offset, 0.0);
  const double cubes = cubes_.value() - 3.0 * offset * raw + 2.0 * n * offset * offset * offset;
  const double fourths = fourths_.value() - 4.0 * offset * cubes_.value() +
                         6.0 * offset * offset * raw - 3.0 * n * offset * offset * offset * offset;
  return {.count = count_,
          .mean = centre_ + unit * offset,
          .standard_deviation = count_ < 2 ? 0.0 : unit * std::sqrt(squares / (n - 1.0)),
          .rms = unit * std::sqrt(raw_squares_.value() / n),
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
