#include "core/statistics/sequential.hpp"

#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

// Bisections of an interval in [0, 1]: it ends below the spacing of doubles near 1e-3.
constexpr int num_bisections = 64;

/// tail·factor/power. A power of 0 is below the range of doubles: the hits are far from their
/// expectation, on the side where the tail is 1 or on the one where it is 0.
double ratio(double tail, double factor, double power) {
  if (tail <= 0.0) return 0.0;
  if (power <= 0.0) return tail > 0.5 ? std::numeric_limits<double>::infinity() : 0.0;
  return tail * factor / power;
}

}  // namespace

double evidence_of_less(double num_hits, double num_runs, double probability) {
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs);
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  const double a = num_hits + 0.5;
  const double b = num_runs - num_hits + 1.0;
  return ratio(beta_at_most(probability, a, b), 0.5 * (1.0 - probability),
               beta_power(probability, a, b));
}

double evidence_of_more(double num_hits, double num_runs, double probability) {
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs);
  PROOFMASS_EXPECT(probability > 0.0 && probability < 1.0);
  if (num_hits < 1.0) return 0.0;
  const double a = num_hits - 0.5;
  const double b = num_runs - num_hits + 1.0;
  // (1 − p)/(1 − √p) = 1 + √p.
  return ratio(beta_above(probability, a, b), 0.5 * (1.0 + std::sqrt(probability)),
               beta_power(probability, a, b));
}

Interval sequential_bounds(double num_hits, double num_runs, double confidence) {
  detail::check_fraction("confidence", confidence);
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs && num_runs > 0.0);
  const double enough = 1.0 / (1.0 - confidence);
  const double rate = num_hits / num_runs;
  double excluded_low = 0.0;
  double excluded_high = 1.0;
  double lower = rate;
  double upper = rate;
  // The evidence grows with the distance from the rate, on either side.
  for (int i = 0; i < num_bisections; ++i) {
    const double high = 0.5 * (upper + excluded_high);
    const double low = 0.5 * (lower + excluded_low);
    const bool is_high = high < 1.0 && evidence_of_less(num_hits, num_runs, high) >= enough;
    const bool is_low = low > 0.0 && evidence_of_more(num_hits, num_runs, low) >= enough;
    (is_high ? excluded_high : upper) = high;
    (is_low ? excluded_low : lower) = low;
  }
  return {.lower = excluded_low, .upper = excluded_high, .confidence = confidence};
}

}  // namespace proofmass
