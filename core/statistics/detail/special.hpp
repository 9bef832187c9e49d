#pragma once

namespace proofmass::detail {

// Incomplete beta and gamma functions in the elementary functions of core/math: the same bits on
// every processor. Relative error of the smaller tail below 1e-13 up to parameters of 1e4, below
// 1e-11 up to 1e9, measured in tests/validation.

/// Both tails of a distribution, of which the smaller one has full precision.
struct Tails {
  double lower = 0.0;
  double upper = 0.0;
};

/// xᵃ yᵇ/B(a, b) for a, b > 0 and x + y = 1, both given so that the smaller one keeps its digits.
[[nodiscard]] double beta_power(double a, double b, double x, double y);

/// Regularised incomplete beta function I_x(a, b) and 1 − I_x(a, b), arguments as beta_power().
[[nodiscard]] Tails regularised_beta(double a, double b, double x, double y);

/// xᵃ e⁻ˣ/Γ(a + 1) for a > 0, x ≥ 0.
[[nodiscard]] double gamma_power(double a, double x);

/// Regularised incomplete gamma functions P(a, x) and Q(a, x), a > 0, x ≥ 0.
[[nodiscard]] Tails regularised_gamma(double a, double x);

}  // namespace proofmass::detail
