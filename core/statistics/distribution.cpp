#include "core/statistics/distribution.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/random/normal.hpp"
#include "core/statistics/detail/special.hpp"

namespace proofmass {
namespace {

using detail::Tails;

struct Bracket {
  double lower, upper;
};

/// How far a point lies above the root, in probability, and the density there.
struct Excess {
  double probability, density;
};

/// Root of a function that grows through the bracket: Newton's steps, halving where they leave it.
template <typename Function>
double find_root(const Function& excess_at, Bracket bracket, double start) {
  constexpr int num_steps_max = 200;
  double x = start;
  for (int i = 0; i < num_steps_max; ++i) {
    const Excess excess = excess_at(x);
    if (excess.probability == 0.0) break;
    (excess.probability < 0.0 ? bracket.lower : bracket.upper) = x;
    double next = x - excess.probability / excess.density;
    // Also true if the density is 0 and the step not a number.
    if (!(next > bracket.lower && next < bracket.upper)) {
      next = 0.5 * (bracket.lower + bracket.upper);
    }
    const bool is_found = std::abs(next - x) <= 4e-16 * std::abs(x);
    x = next;
    if (is_found) break;
  }
  return x;
}

/// Difference to the wanted probability by the tail that has full precision.
double excess_of(const Tails& tails, double probability) {
  return probability <= 0.5 ? tails.lower - probability : (1.0 - probability) - tails.upper;
}

void expect_probability(double probability) {
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
}

}  // namespace

double normal_cumulative(double x) {
  const Tails tails = detail::regularised_gamma(0.5, 0.5 * x * x);
  return x < 0.0 ? 0.5 * tails.upper : 0.5 + 0.5 * tails.lower;
}

double student_two_sided(double t, double degrees) {
  const double sum = degrees + t * t;
  return detail::regularised_beta(0.5 * degrees, 0.5, degrees / sum, t * t / sum).lower;
}

double student_quantile(double probability, double degrees) {
  expect_probability(probability);
  if (probability == 0.5) return 0.0;
  const double two_sided = 2.0 * std::min(probability, 1.0 - probability);
  const auto excess_at = [&](double t) {
    const double sum = degrees + t * t;
    const double power = detail::beta_power(0.5 * degrees, 0.5, degrees / sum, t * t / sum);
    return Excess{two_sided - student_two_sided(t, degrees), 2.0 * power / t};
  };
  double upper = 2.0;
  while (student_two_sided(upper, degrees) > two_sided) upper *= 2.0;
  const double t =
      find_root(excess_at, {0.0, upper}, std::min(-inverse_normal(0.5 * two_sided), 0.5 * upper));
  return probability < 0.5 ? -t : t;
}

double beta_quantile(double probability, double a, double b) {
  expect_probability(probability);
  const auto excess_at = [&](double x) {
    const double density = detail::beta_power(a, b, x, 1.0 - x) / (x * (1.0 - x));
    return Excess{excess_of(detail::regularised_beta(a, b, x, 1.0 - x), probability), density};
  };
  return find_root(excess_at, {0.0, 1.0}, a / (a + b));
}

double fisher_quantile(double probability, double numerator_degrees, double denominator_degrees) {
  // F = x/y · b/a with x + y = 1, the smaller of which is solved for.
  const double a = 0.5 * numerator_degrees;
  const double b = 0.5 * denominator_degrees;
  double x = beta_quantile(probability, a, b);
  double y = 1.0 - x;
  if (x > 0.5) {
    y = beta_quantile(1.0 - probability, b, a);
    x = 1.0 - y;
  }
  return x / y * b / a;
}

double binomial_at_most(double k, double n, double probability) {
  if (k < 0.0) return 0.0;
  if (k >= n) return 1.0;
  return detail::regularised_beta(k + 1.0, n - k, probability, 1.0 - probability).upper;
}

double binomial_at_least(double k, double n, double probability) {
  if (k <= 0.0) return 1.0;
  if (k > n) return 0.0;
  return detail::regularised_beta(k, n - k + 1.0, probability, 1.0 - probability).lower;
}

double kolmogorov_upper(double x) {
  if (x < 0.03) return 1.0;  // The complement is below 1e-300.
  const double x2 = x * x;
  double sum = 0.0;
  // Two series of one function; each needs four terms on its side.
  if (x < 1.0) {
    const double rate = std::numbers::pi * std::numbers::pi / (8.0 * x2);
    for (int k = 7; k >= 1; k -= 2) sum += exponential(std::max(-k * k * rate, -699.0));
    return 1.0 - std::sqrt(2.0 * std::numbers::pi) / x * sum;
  }
  for (int k = 6; k >= 1; --k) {
    sum += (k % 2 == 1 ? 2.0 : -2.0) * exponential(std::max(-2.0 * k * k * x2, -699.0));
  }
  return sum;
}

}  // namespace proofmass
