#pragma once

#include <complex>

#include "core/math/inline.hpp"

namespace proofmass {

/// Second-order recursive filter y = (b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²) x.
struct Biquad {
  double b0, b1, b2, a1, a2;
};

/// Butterworth sections of second order, bilinear transform with the corner kept in place.
/// 0 < corner_hz < ½/sample_period_s.
[[nodiscard]] Biquad butterworth_low_pass(double corner_hz, double sample_period_s);
[[nodiscard]] Biquad butterworth_high_pass(double corner_hz, double sample_period_s);

/// The pass-band filter of [Hardy2013] section 5.2: a high-pass and a low-pass Butterworth section.
struct BandPass {
  Biquad high_pass;
  Biquad low_pass;
};

[[nodiscard]] BandPass band_pass(double low_corner_hz, double high_corner_hz,
                                 double sample_period_s);

/// Leaves every signal as it is.
inline constexpr BandPass no_filter{{1.0, 0.0, 0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0, 0.0}};

/// What becomes of cos 2πft + i sin 2πft: the filter's factor, for a frequency below half the
/// sampling rate.
[[nodiscard]] std::complex<double> response(const BandPass& filter, double frequency_hz,
                                            double sample_period_s);

/// Memory of a Biquad (transposed direct form II), of one signal or of those in a vector T.
template <typename T>
struct BiquadStateOf {
  T s1{};
  T s2{};

  /// Replaces the next sample of the signal by that of the filtered one.
  PROOFMASS_INLINE void filter(const Biquad& filter, T& signal) {
    const T x = signal;
    signal = filter.b0 * x + s1;
    s1 = filter.b1 * x - filter.a1 * signal + s2;
    s2 = filter.b2 * x - filter.a2 * signal;
  }
  /// The next sample of the filtered signal.
  [[nodiscard]] T advance(const Biquad& filter, T x) {
    this->filter(filter, x);
    return x;
  }
};

/// Memory of a BandPass.
template <typename T>
struct BandPassStateOf {
  BiquadStateOf<T> high_pass;
  BiquadStateOf<T> low_pass;

  /// Replaces the next sample of the signal by that of the filtered one.
  PROOFMASS_INLINE void filter(const BandPass& filter, T& signal) {
    high_pass.filter(filter.high_pass, signal);
    low_pass.filter(filter.low_pass, signal);
  }
  /// The next sample of the filtered signal.
  [[nodiscard]] T advance(const BandPass& filter, T x) {
    this->filter(filter, x);
    return x;
  }
};

using BiquadState = BiquadStateOf<double>;
using BandPassState = BandPassStateOf<double>;

}  // namespace proofmass
