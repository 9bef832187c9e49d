#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/math/complex.hpp"

namespace proofmass {

/// One-sided PSD white²·(1 + f_p/f) + rise²·(f/f_r)⁴ / (1 + (f/f_l)⁴); no limit if f_l = 0.
struct SensorNoise {
  double white_asd = 0.0;  ///< unit/√Hz.
  double pink_corner_hz = 0.0;
  double rise_asd = 0.0;  ///< unit/√Hz; 0 for no rise.
  double rise_corner_hz = 0.03;
  double rise_limit_hz = 0.0;
};

/// A rational filter of one white sequence, in parallel form:
///
///     yₖ = gain·wₖ + Σ cᵢ sᵢ + 2 Re(C S),    sᵢ ← pᵢ sᵢ + wₖ,    S ← P S + wₖ
///
/// with at most one pair of complex poles.
struct NoiseFilter {
  static constexpr std::size_t num_poles_max = 12;

  double gain = 0.0;
  std::size_t num_real = 0;
  std::array<double, num_poles_max> pole{};
  std::array<double, num_poles_max> coefficient{};
  bool has_pair = false;
  ComplexDouble pair_pole;
  ComplexDouble pair_coefficient;
};

/// A coloured noise: a filter that is driven by white noise of unit variance. Its states have the
/// covariance 1/(1 − pᵢpⱼ), so a stationary start is a matter of one triangular matrix.
struct NoiseShape : NoiseFilter {
  /// Lower Cholesky factor of the stationary covariance of (s₁ … sₙ, Re S, Im S), rows first.
  std::vector<double> start_factor;

  [[nodiscard]] std::size_t num_states() const { return num_real + (has_pair ? 2 : 0); }
  /// One-sided PSD of y at a frequency, unit²/Hz.
  [[nodiscard]] double psd(double frequency_hz, double sample_period_s) const;
};

/// One-sided PSD that a sensor's noise is asked to have, unit²/Hz; frequency_hz > 0.
[[nodiscard]] double nominal_psd(const SensorNoise& noise, double frequency_hz);

/// Filter whose output follows nominal_psd() within 0.5 dB from 2e-5 to 1 Hz at 4 Hz sampling, for
/// a rise without limit or one that ends below 0.6 Hz.
///
/// 1/f becomes a sum of first-order spectra a factor 8 apart (ripple 0.15 dB); the f⁴ rise becomes
/// x²/((1 − x/9.5)(1 − x/12)) of x = 4 sin²(πfT), which cancels the difference of sin² from its
/// argument up to half the Nyquist frequency. Their sum is rational in x; its zeros give the one
/// filter with that spectrum that has all zeros and poles inside the unit circle.
[[nodiscard]] NoiseShape shape_noise(const SensorNoise& noise, double sample_period_s);

}  // namespace proofmass
