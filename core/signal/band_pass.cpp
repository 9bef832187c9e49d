#include "core/signal/band_pass.hpp"

#include <numbers>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

/// tan(π f T): the corner on the bilinear transform's frequency axis.
double warped(double corner_hz, double sample_period_s) {
  const auto [sine, cosine] = sincos_turns(0.5 * corner_hz * sample_period_s);
  return sine / cosine;
}

/// Denominator of 1/(s² + √2 s + 1) at s = (1 − z⁻¹)/(k (1 + z⁻¹)); `numerator` is that of the
/// filter.
Biquad section(double k, double b0, double b1, double b2) {
  const double norm = 1.0 + std::numbers::sqrt2 * k + k * k;
  return {b0 / norm, b1 / norm, b2 / norm, 2.0 * (k * k - 1.0) / norm,
          (1.0 - std::numbers::sqrt2 * k + k * k) / norm};
}

/// @param delay  z⁻¹.
std::complex<double> response(const Biquad& filter, std::complex<double> delay) {
  return (filter.b0 + delay * (filter.b1 + delay * filter.b2)) /
         (1.0 + delay * (filter.a1 + delay * filter.a2));
}

}  // namespace

Biquad butterworth_low_pass(double corner_hz, double sample_period_s) {
  const double k = warped(corner_hz, sample_period_s);
  return section(k, k * k, 2.0 * k * k, k * k);
}

Biquad butterworth_high_pass(double corner_hz, double sample_period_s) {
  return section(warped(corner_hz, sample_period_s), 1.0, -2.0, 1.0);
}

BandPass band_pass(double low_corner_hz, double high_corner_hz, double sample_period_s) {
  return {butterworth_high_pass(low_corner_hz, sample_period_s),
          butterworth_low_pass(high_corner_hz, sample_period_s)};
}

std::complex<double> response(const BandPass& filter, double frequency_hz, double sample_period_s) {
  const auto [sine, cosine] = sincos_turns(frequency_hz * sample_period_s);
  const std::complex<double> delay(cosine, -sine);
  return response(filter.high_pass, delay) * response(filter.low_pass, delay);
}

}  // namespace proofmass
