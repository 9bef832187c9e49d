#include "core/signal/band_pass.hpp"

#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<long double>;

constexpr long double pi = std::numbers::pi_v<long double>;

/// s/ω_c of the bilinear transform that keeps the corner: i tan(πfT)/tan(πf_cT).
Complex warped(double frequency_hz, double corner_hz) {
  return {0.0L, std::tan(pi * frequency_hz * period_s) / std::tan(pi * corner_hz * period_s)};
}

Complex low_pass_response(double frequency_hz, double corner_hz) {
  const Complex s = warped(frequency_hz, corner_hz);
  return 1.0L / (s * s + std::numbers::sqrt2_v<long double> * s + 1.0L);
}

Complex high_pass_response(double frequency_hz, double corner_hz) {
  const Complex s = warped(frequency_hz, corner_hz);
  return s * s / (s * s + std::numbers::sqrt2_v<long double> * s + 1.0L);
}

Complex band_pass_response(double frequency_hz, double low_hz, double high_hz) {
  return high_pass_response(frequency_hz, low_hz) * low_pass_response(frequency_hz, high_hz);
}

/// Σ hₖ e^{−2πifkT} of the recursion's answer to a unit impulse.
template <typename State, typename Filter>
Complex measured_response(const Filter& filter, double frequency_hz, std::size_t num_samples) {
  const long double angle = -2.0L * pi * frequency_hz * period_s;
  const Complex step(std::cos(angle), std::sin(angle));
  State state;
  Complex sum = 0.0L;
  Complex phasor = 1.0L;
  for (std::size_t k = 0; k < num_samples; ++k) {
    sum += static_cast<long double>(state.advance(filter, k == 0 ? 1.0 : 0.0)) * phasor;
    phasor *= step;
  }
  return sum;
}

/// Samples after which the slowest pole, decaying as e^(−√½ω_c t), is below 1e-17.
std::size_t samples_to_rest(double lowest_corner_hz) {
  return static_cast<std::size_t>(10.0 / (lowest_corner_hz * period_s));
}

// A coefficient's rounding, 2e-16, moves a pole whose distance from 1 is k = πf_cT·√2 by 2e-16/k,
// and the response by 2e-16/k²: 1e-7 at the lowest corner, 1e-13 at the highest.
double response_tolerance(double lowest_corner_hz) {
  const double k = std::tan(std::numbers::pi * lowest_corner_hz * period_s);
  return 1e-14 + 4e-16 / (k * k);
}

/// Corners of the sessions' bands: 2 f_orb, f_cal, 2 f_TM, each a third and three times.
const std::vector<double>& corners() {
  static const std::vector<double> values{1.12e-4, 4.1e-4, 1.0e-3, 3.7e-3, 6.6e-3, 5.9e-2, 0.5};
  return values;
}

TEST(Butterworth, HasTheTransformedResponse) {
  for (const double corner : corners()) {
    for (const double ratio : {0.0, 0.1, 0.5, 1.0, 2.0, 3.7}) {
      const double frequency = ratio * corner;
      const auto expect = [&](const Biquad& filter, const Complex& expected) {
        const Complex actual =
            measured_response<BiquadState>(filter, frequency, samples_to_rest(corner));
        EXPECT_LT(std::abs(actual - expected), response_tolerance(corner))
            << corner << ", " << ratio;
      };
      expect(butterworth_low_pass(corner, period_s), low_pass_response(frequency, corner));
      expect(butterworth_high_pass(corner, period_s), high_pass_response(frequency, corner));
    }
  }
}

TEST(BandPass, IsTheProductOfItsSections) {
  const double line = 2.0 / 5950.0;
  const BandPass filter = band_pass(line / 3.0, line * 3.0, period_s);
  for (const double ratio : {0.0, 0.1, 1.0 / 3.0, 0.5, 1.0, 2.0, 3.0, 20.0}) {
    const double frequency = ratio * line;
    const Complex expected = band_pass_response(frequency, line / 3.0, line * 3.0);
    const Complex actual =
        measured_response<BandPassState>(filter, frequency, samples_to_rest(line / 3.0));
    EXPECT_LT(std::abs(actual - expected), response_tolerance(line / 3.0)) << ratio;
  }
}

TEST(BandPass, KnowsItsResponse) {
  const double line = 2.0 / 5950.0;
  const BandPass filter = band_pass(line / 3.0, line * 3.0, period_s);
  for (const double ratio : {0.1, 0.5, 1.0, 3.0, 20.0, 5000.0}) {
    const double frequency = ratio * line;
    const Complex expected = band_pass_response(frequency, line / 3.0, line * 3.0);
    EXPECT_LT(std::abs(Complex(response(filter, frequency, period_s)) - expected),
              response_tolerance(line / 3.0))
        << ratio;
  }
}

}  // namespace
}  // namespace proofmass
