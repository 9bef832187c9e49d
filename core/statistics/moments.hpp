#pragma once

#include <cmath>
#include <cstddef>
#include <span>

namespace proofmass {

/// Sum whose rounding error does not grow with the number of terms [Neumaier1974]: what each
/// addition loses is added up apart.
class CompensatedSum {
 public:
  void add(double term) {
    const double sum = sum_ + term;
    const bool term_is_small = std::abs(sum_) >= std::abs(term);
    lost_ += term_is_small ? (sum_ - sum) + term : (term - sum) + sum_;
    sum_ = sum;
  }
  /// @param factor  A power of two.
  void multiply(double factor) {
    sum_ *= factor;
    lost_ *= factor;
  }
  [[nodiscard]] double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0.0;
  double lost_ = 0.0;
};

/// Compensated sum in the order of the values; 0 for none.
[[nodiscard]] inline double compensated_sum(std::span<const double> values) {
  CompensatedSum sum;
  for (const double value : values) sum.add(value);
  return sum.value();
}

/// Moments of values in their order.
///
/// Two passes: a compensated sum yields the mean, rounded to a double c; then the compensated sums
/// of d, d² and d³ with d = x − c, each corrected for what c lacks:
///
///     mean = c + d̄      Σ(x − mean)² = Σd² − n d̄²      Σ(x − mean)³ = Σd³ − 3 d̄ Σd² + 2 n d̄³
///     Σ(x − mean)⁴ = Σd⁴ − 4 d̄ Σd³ + 6 d̄² Σd² − 3 n d̄⁴
///
/// Powers are those of d times a power of two, that of c or, once a |d| is too far above it, of
/// that one: none of any doubles up to 1e150 leaves their range. README.md derives the error, a few
/// 1e-16 even for values 1e8 ± 2e-4.
struct Moments {
  std::size_t count = 0;
  double mean = 0.0;                ///< Unit of the values.
  double standard_deviation = 0.0;  ///< With n − 1; 0 for a single value.
  double rms = 0.0;                 ///< √(Σx²/n).
  /// Adjusted Fisher-Pearson G1 = √(n(n − 1))/(n − 2) · m₃/m₂^1.5, the `skew(bias=False)` of scipy;
  /// 0 below three values or if all are equal.
  double skewness = 0.0;
  /// Adjusted G2 = (n − 1)/((n − 2)(n − 3)) ((n + 1)(m₄/m₂² − 3) + 6), the `kurtosis(bias=False)`
  /// of scipy: 0 for a normal law. 0 below four values or if all are equal.
  double excess_kurtosis = 0.0;
};

/// @throws InvalidArgument if there is no value or one is not finite.
[[nodiscard]] Moments moments(std::span<const double> values);

/// The power of two that brings a value between 1 and 2, or as near as doubles can; 0 for 0.
[[nodiscard]] double scale_of(double value);

/// The second pass of moments(), for values that are seen one by one.
class MomentSums {
 public:
  /// @param centre  Compensated sum of all values, divided by their count.
  explicit MomentSums(double centre) : centre_(centre), scale_(scale_of(centre)) {}

  void add(double value);
  /// @pre All values were added; at least one.
  [[nodiscard]] Moments moments() const;

 private:
  void scale_by(double scale);

  double centre_;
  double scale_;  ///< Of x and d in the sums; 0 while all values are 0.
  std::size_t count_ = 0;
  CompensatedSum raw_squares_, differences_, squares_, cubes_,
      fourths_;  ///< Of x², d, d², d³ and d⁴.
};

}  // namespace proofmass
