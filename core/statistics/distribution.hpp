#pragma once

namespace proofmass {

// Distribution functions and quantiles, of Boost.Math. Their last bits may depend on the processor
// and on the version of Boost; tests/validation bounds their errors against scipy and mpmath.

/// Φ(x).
[[nodiscard]] double normal_cumulative(double x);

/// P(|T| ≥ |t|) of Student's law with `degrees` > 0 of freedom.
[[nodiscard]] double student_two_sided(double t, double degrees);

/// t with P(T ≤ t) = probability in (0, 1).
[[nodiscard]] double student_quantile(double probability, double degrees);

/// I_x(a, b), the regularised incomplete beta function, for x in [0, 1]; a, b > 0.
[[nodiscard]] double beta_at_most(double x, double a, double b);

/// 1 − I_x(a, b), with full precision where that is small.
[[nodiscard]] double beta_above(double x, double a, double b);

/// xᵃ (1 − x)ᵇ/B(a, b) for x in (0, 1).
[[nodiscard]] double beta_power(double x, double a, double b);

/// x with I_x(a, b) = probability in (0, 1).
[[nodiscard]] double beta_quantile(double probability, double a, double b);

/// P(X ≤ x) of the χ² law, x ≥ 0.
[[nodiscard]] double chi_square_at_most(double x, double degrees);

/// P(X > x), with full precision where that is small.
[[nodiscard]] double chi_square_above(double x, double degrees);

/// x with P(X ≤ x) = probability in (0, 1).
[[nodiscard]] double chi_square_quantile(double probability, double degrees);

/// P(X ≤ k) of X ~ Bin(n, probability), 0 < probability < 1. Counts may be fractions: the
/// incomplete beta function then interpolates.
[[nodiscard]] double binomial_at_most(double k, double n, double probability);

/// P(X ≥ k), the same way.
[[nodiscard]] double binomial_at_least(double k, double n, double probability);

/// P(K ≥ x) of Kolmogorov's law, the limit for √n D.
[[nodiscard]] double kolmogorov_upper(double x);

}  // namespace proofmass
