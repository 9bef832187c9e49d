#include "core/statistics/detail/special.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

namespace proofmass::detail {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double epsilon = std::numeric_limits<double>::epsilon();
// Fractions converge in some √(a + b) steps, which is 1e5 for the largest campaigns.
constexpr int num_steps_max = 10'000'000;

/// eˣ, and 0 where it is below 1e-304.
double exponential_or_zero(double x) { return x < -700.0 ? 0.0 : exponential(x); }

/// ln Γ(n + 1) − ln(√(2πn) (n/e)ⁿ), n > 0: Stirling's series from 16 on, below by recurrence
/// [Loader2000].
double stirling_error(double n) {
  double error = 0.0;
  for (; n < 16.0; n += 1.0) error += (n + 0.5) * logarithm((n + 1.0) / n) - 1.0;
  const double s = 1.0 / (n * n);
  const double series =
      1.0 / 12 -
      s * (1.0 / 360 - s * (1.0 / 1260 - s * (1.0 / 1680 - s * (1.0 / 1188 - s * 691.0 / 360360))));
  return error + series / n;
}

/// x ln(x/mean) + mean − x for x, mean > 0, by a series where it would cancel [Loader2000].
/// @param difference  x − mean, which the caller may know with more digits.
double deviance(double x, double mean, double difference) {
  if (std::abs(difference) >= 0.1 * (x + mean)) return x * logarithm(x / mean) - difference;
  const double ratio = difference / (x + mean);
  double sum = difference * ratio;
  double term = 2.0 * x * ratio;
  for (int j = 1;; ++j) {
    term *= ratio * ratio;
    const double next = sum + term / (2 * j + 1);
    if (next == sum) return sum;
    sum = next;
  }
}

double kept_from_zero(double x) {
  constexpr double tiny = 1e-300;
  return std::abs(x) < tiny ? tiny : x;
}

/// Evaluates d₀ + n₁/(d₁ + n₂/(d₂ + ...)) from the front, as Lentz modified it.
class Fraction {
 public:
  explicit Fraction(double denominator)
      : value_(kept_from_zero(denominator)), upper_(value_), lower_(0.0) {}

  /// Appends a level; true if it did not change the value any more.
  bool append(double numerator, double denominator) {
    lower_ = 1.0 / kept_from_zero(denominator + numerator * lower_);
    upper_ = kept_from_zero(denominator + numerator / upper_);
    value_ *= upper_ * lower_;
    return std::abs(upper_ * lower_ - 1.0) <= epsilon;
  }
  [[nodiscard]] double value() const { return value_; }

 private:
  double value_, upper_, lower_;
};

/// (a + b)x subtracted from a, by whichever of x and y = 1 − x is the smaller and has its digits.
double distance_below_mean(double a, double b, double x, double y) {
  const double n = a + b;
  return x < y ? a - n * x : n * y - b;
}

/// The fraction of I_x(a, b) = xᵃyᵇ/B(a, b) / fraction, the even part of [DLMF] 8.17.22
/// [DidonatoMorris1992]. x and y enter apart from `distance` only where nothing cancels.
double beta_fraction(double a, double b, double x, double distance) {
  Fraction fraction(a / (a + 1.0) * (distance + 1.0));
  for (int m = 1; m < num_steps_max; ++m) {
    const double middle = a + 2.0 * m - 1.0;
    const double numerator =
        (a + m - 1.0) / middle * ((a + b + m - 1.0) / middle) * m * (b - m) * x * x;
    const double denominator =
        m + m * (b - m) * x / middle + (a + m) / (middle + 2.0) * (distance + 1.0 + m * (2.0 - x));
    if (fraction.append(numerator, denominator)) return fraction.value();
  }
  PROOFMASS_EXPECT(false);
  return 0.0;
}

/// Σ xⁱ/((a + 1)...(a + i)), [DLMF] 8.11.4.
double gamma_series(double a, double x) {
  double term = 1.0;
  double sum = 1.0;
  for (double denominator = a + 1.0; term > 0.25 * epsilon * sum; denominator += 1.0) {
    term *= x / denominator;
    sum += term;
  }
  return sum;
}

/// The fraction of Γ(a, x) = xᵃe⁻ˣ / fraction, the even part of [DLMF] 8.9.2.
double gamma_fraction(double a, double x) {
  const double first = x - a + 1.0;
  Fraction fraction(first);
  for (int m = 1; m < num_steps_max; ++m) {
    if (fraction.append(-m * (m - a), first + 2.0 * m)) return fraction.value();
  }
  PROOFMASS_EXPECT(false);
  return 0.0;
}

}  // namespace

double beta_power(double a, double b, double x, double y) {
  if (x <= 0.0 || y <= 0.0) return 0.0;
  const double n = a + b;
  const double distance = distance_below_mean(a, b, x, y);
  const double exponent = stirling_error(n) - stirling_error(a) - stirling_error(b) -
                          deviance(a, n * x, distance) - deviance(b, n * y, -distance);
  return std::sqrt(a / n * b / two_pi) * exponential_or_zero(exponent);
}

Tails regularised_beta(double a, double b, double x, double y) {
  PROOFMASS_EXPECT(a > 0.0 && b > 0.0);
  if (x <= 0.0) return {0.0, 1.0};
  if (y <= 0.0) return {1.0, 0.0};
  const double power = beta_power(a, b, x, y);
  const double distance = distance_below_mean(a, b, x, y);
  // The fractions converge fast, with positive terms, on their own side of the mean.
  if (distance >= 0.0) {
    const double lower = power / beta_fraction(a, b, x, distance);
    return {lower, 1.0 - lower};
  }
  const double upper = power / beta_fraction(b, a, y, -distance);
  return {1.0 - upper, upper};
}

double gamma_power(double a, double x) {
  if (x <= 0.0) return 0.0;
  return exponential_or_zero(-stirling_error(a) - deviance(a, x, a - x)) / std::sqrt(two_pi * a);
}

Tails regularised_gamma(double a, double x) {
  PROOFMASS_EXPECT(a > 0.0);
  if (x <= 0.0) return {0.0, 1.0};
  if (x < a + 1.0) {
    const double lower = gamma_power(a, x) * gamma_series(a, x);
    return {lower, 1.0 - lower};
  }
  const double upper = gamma_power(a, x) * a / gamma_fraction(a, x);
  return {1.0 - upper, upper};
}

}  // namespace proofmass::detail
