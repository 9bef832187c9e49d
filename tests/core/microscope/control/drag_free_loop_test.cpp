#include "core/microscope/control/drag_free_loop.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

namespace proofmass {
namespace {

constexpr double period_s = 0.25;

// L(z) = z⁻¹ ω_cT/(1 − z⁻¹) (1 + ω_iT/(1 − z⁻¹)) at z = e^{2πi f T}.
std::complex<double> sampled_open_loop(const DragFreeConfig& config, double frequency_hz) {
  const std::complex<double> delay =
      std::polar(1.0, -2.0 * std::numbers::pi * frequency_hz * period_s);
  const double omega_c = 2.0 * std::numbers::pi * config.bandwidth_hz;
  const double omega_i = 2.0 * std::numbers::pi * config.integral_hz;
  return delay * omega_c * period_s / (1.0 - delay) * (1.0 + omega_i * period_s / (1.0 - delay));
}

// Impulse response of the controller alone, summed against e^{−2πifTk}, is its transfer function;
// an integrator's response does not decay, so the comparison is made just inside the unit circle's
// outside: on |z| = 1.001.
TEST(DragFreeController, HasTheSampledTransferFunction) {
  const DragFreeConfig config;
  const DragFreeGains gains = drag_free_gains(config, period_s);
  for (const double frequency_hz : {0.0, 1e-3, 0.05, 0.7}) {
    DragFreeController<double> controller;
    const std::complex<double> inverse_z =
        std::polar(1.0 / 1.001, -2.0 * std::numbers::pi * frequency_hz * period_s);
    std::complex<double> sum = 0.0;
    std::complex<double> power = 1.0;
    for (int k = 0; k < 60000; ++k) {  // 1.001^-60000 = 1e-26.
      sum += power * controller.advance(gains, {k == 0 ? 1.0 : 0.0, 0.0, 0.0}).x;
      power *= inverse_z;
    }
    const double omega_c = 2.0 * std::numbers::pi * config.bandwidth_hz;
    const double omega_i = 2.0 * std::numbers::pi * config.integral_hz;
    const std::complex<double> expected =
        omega_c * period_s / (1.0 - inverse_z) * (1.0 + omega_i * period_s / (1.0 - inverse_z));
    EXPECT_NEAR(std::abs(sum / expected - 1.0), 0.0, 1e-9) << frequency_hz;
  }
}

TEST(DragFreeLoop, IsStableWithGoodMargins) {
  // Nyquist by the largest |1/(1 + L)|: below 2 (6 dB), the distance from −1 is at least ½.
  const DragFreeConfig config;
  double largest = 0.0;
  for (double f = 1e-4; f < 2.0; f *= 1.01) {
    largest = std::max(largest, 1.0 / std::abs(1.0 + sampled_open_loop(config, f)));
  }
  EXPECT_LT(largest, 2.0);
}

}  // namespace
}  // namespace proofmass
