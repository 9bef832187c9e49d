#pragma once

#include <cstdint>

namespace proofmass {

// Distribution functions and quantiles with the same bits on every processor. Errors are bounded
// against scipy in tests/validation.

/// Φ(x).
[[nodiscard]] double normal_cumulative(double x);

/// P(|T| ≥ |t|) of Student's law with `degrees` > 0 of freedom.
[[nodiscard]] double student_two_sided(double t, double degrees);

/// t with P(T ≤ t) = probability in (0, 1).
[[nodiscard]] double student_quantile(double probability, double degrees);

/// x with I_x(a, b) = probability in (0, 1); a, b > 0.
[[nodiscard]] double beta_quantile(double probability, double a, double b);

/// F with P(F ≤ x) = probability in (0, 1), for the ratio of two mean squares.
[[nodiscard]] double fisher_quantile(double probability, double numerator_degrees,
                                     double denominator_degrees);

/// P(X ≤ k) of X ~ Bin(n, probability), 0 < probability < 1. Counts may be fractions: the
/// incomplete beta function then interpolates.
[[nodiscard]] double binomial_at_most(double k, double n, double probability);

/// P(X ≥ k), the same way.
[[nodiscard]] double binomial_at_least(double k, double n, double probability);

/// P(K ≥ x) of Kolmogorov's law, the limit for √n D.
[[nodiscard]] double kolmogorov_upper(double x);

}  // namespace proofmass
