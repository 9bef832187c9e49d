#include "core/statistics/distribution.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/beta.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

// Boost computes in `long double` and rounds the result. Its exceptions for arguments outside the
// domain of a function mean a bug: they end the program as any exception does that nobody expects.
namespace proofmass {

double normal_cumulative(double x) { return 0.5 * boost::math::erfc(-x / std::numbers::sqrt2); }

double student_two_sided(double t, double degrees) {
  const boost::math::students_t law(degrees);
  return 2.0 * boost::math::cdf(boost::math::complement(law, std::abs(t)));
}

double student_quantile(double probability, double degrees) {
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  return boost::math::quantile(boost::math::students_t(degrees), probability);
}

double beta_at_most(double x, double a, double b) { return boost::math::ibeta(a, b, x); }

double beta_above(double x, double a, double b) { return boost::math::ibetac(a, b, x); }

double beta_power(double x, double a, double b) {
  return boost::math::ibeta_derivative(a, b, x) * x * (1.0 - x);
}

double beta_quantile(double probability, double a, double b) {
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  return boost::math::ibeta_inv(a, b, probability);
}

double chi_square_at_most(double x, double degrees) {
  return boost::math::gamma_p(0.5 * degrees, 0.5 * x);
}

double chi_square_above(double x, double degrees) {
  return boost::math::gamma_q(0.5 * degrees, 0.5 * x);
}

double chi_square_quantile(double probability, double degrees) {
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  return 2.0 * boost::math::gamma_p_inv(0.5 * degrees, probability);
}

double binomial_at_most(double k, double n, double probability) {
  if (k < 0.0) return 0.0;
  if (k >= n) return 1.0;
  return beta_above(probability, k + 1.0, n - k);
}

double binomial_at_least(double k, double n, double probability) {
  if (k <= 0.0) return 1.0;
  if (k > n) return 0.0;
  return beta_at_most(probability, k, n - k + 1.0);
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
