#include "core/microscope/control/controller.hpp"

#include <cmath>
#include <complex>
#include <numbers>

#include "core/error.hpp"
#include "core/microscope/control/margins.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Complex = std::complex<double>;

ControllerConfig some_controller() {
  ControllerConfig config;
  config.gain = 0.7;
  config.zeros_rad_s = {{-0.02, 0.0}, {-0.1, 0.3}, {-0.1, -0.3}};
  config.poles_rad_s = {{0.0, 0.0}, {-1.5, 0.0}, {-0.4, -0.2}, {-0.4, 0.2}, {-0.003, 0.0}};
  return config;
}

/// C(s) by its definition.
Complex law(const ControllerConfig& config, const Complex& s) {
  Complex product = config.gain;
  for (const Complex& zero : config.zeros_rad_s) product *= s - zero;
  for (const Complex& pole : config.poles_rad_s) product /= s - pole;
  return product;
}

Complex z_inverse_at(double frequency_hz) {
  return std::polar(1.0, -2.0 * pi * frequency_hz * period_s);
}

Complex response(const SampledController& controller, double frequency_hz) {
  const Complex z_inverse = z_inverse_at(frequency_hz);
  const ComplexDouble found = controller.response({z_inverse.real(), z_inverse.imag()});
  return {found.real(), found.imag()};
}

TEST(SampledController, IsItsLawAtTheWarpedFrequency) {
  const ControllerConfig config = some_controller();
  const SampledController controller(config, period_s);
  for (const double f : {1e-4, 1e-3, 0.01, 0.05, 0.3, 1.0}) {
    const Complex expected = law(config, {0.0, 2.0 / period_s * std::tan(pi * f * period_s)});
    const Complex found = response(controller, f);
    EXPECT_NEAR(std::abs(found / expected - 1.0), 0.0, 1e-10) << f;
  }
}

// What comes of a sine once the transients have gone is the response, a delay of three samples in
// it. The slowest pole, 1/300 s, has fallen by e^-20 after 6000 s.
TEST(SampledController, AnswersASineAsItsResponseSays) {
  ControllerConfig config = some_controller();
  config.poles_rad_s[0] = -0.005;
  config.delay_samples = 3;
  SampledController controller(config, period_s);
  constexpr int num_settling = 24000, num_samples = 400;
  constexpr double frequency_hz = 0.05;  // 5 periods of 80 samples.
  Complex sum = 0.0;
  for (int k = 0; k < num_settling + num_samples; ++k) {
    const Complex phase = std::polar(1.0, 2.0 * pi * frequency_hz * period_s * k);
    const double command = controller.advance(phase.real());
    if (k >= num_settling) sum += command * std::conj(phase) * 2.0 / double(num_samples);
  }
  const Complex expected = law(config, {0.0, 2.0 / period_s * std::tan(pi * 0.05 * period_s)}) *
                           std::pow(z_inverse_at(frequency_hz), 3);
  EXPECT_NEAR(std::abs(sum / expected - 1.0), 0.0, 1e-7);
}

TEST(ControllerConfig, RefusesWhatIsNoController) {
  EXPECT_NO_THROW(some_controller().validate("controller[0]", period_s));
  const auto refused = [](const auto& change) {
    ControllerConfig config = some_controller();
    change(config);
    try {
      config.validate("controller[0]", period_s);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("valid");
  };
  EXPECT_THAT(refused([](auto& c) { c.poles_rad_s.resize(2); }),
              testing::HasSubstr("at least as many as the 3 zeros"));
  EXPECT_THAT(refused([](auto& c) { c.poles_rad_s.resize(9); }), testing::HasSubstr("at most 8"));
  EXPECT_THAT(refused([](auto& c) {
                c.zeros_rad_s[1] = {-0.1, 0.31};
              }),
              testing::HasSubstr("zeros_rad_s = [-0.1, 0.31] (must stand beside its conjugate"));
  EXPECT_THAT(refused([](auto& c) { c.poles_rad_s[1] = 0.1; }),
              testing::HasSubstr("[0.1, 0] (must have no positive real part"));
  EXPECT_THAT(refused([](auto& c) { c.poles_rad_s[1] = -4.0; }),
              testing::HasSubstr("must be below 1/sample_period_s, 4 rad/s"));
}

// L = k z⁻¹/(1 − z⁻¹): |L| is 1 where 2 sin(θ/2) = k, with the phase −π/2 − θ/2; at half the sample
// rate L is −k/2. Closed, it is stable up to k = 2.
TEST(Margins, AreThoseOfASampledIntegrator) {
  for (const double k : {1e-3, 0.0785, 0.3, 1.0, 1.9}) {
    const Margins margins = margins_of([k](ComplexDouble z) { return k * z / (1.0 - z); });
    EXPECT_NEAR(margins.gain * k / 2.0, 1.0, 1e-9) << k;
    EXPECT_NEAR(margins.phase_rad, pi / 2.0 - std::asin(k / 2.0), 1e-9) << k;
  }
  EXPECT_EQ(margins_of([](ComplexDouble z) { return 2.01 * z / (1.0 - z); }).gain, 0.0);
}

// Two integrators need a lead: with L = k(1 + a)z⁻¹(1 − c z⁻¹)/(1 − z⁻¹)² the
// characteristic polynomial z² + (b − 2)z + 1 − bc, b = k(1 + a), has its roots inside the unit
// circle if and only if 0 < bc < 2, b(1 − c) > 0 and 4 − b(1 + c) > 0 (Jury).
TEST(Margins, KnowAnUnstableLoop) {
  const auto loop = [](double b, double c) {
    return margins_of(
        [=](ComplexDouble z) { return b * z * (1.0 - c * z) / ((1.0 - z) * (1.0 - z)); });
  };
  EXPECT_EQ(loop(0.01, -0.1).gain, 0.0);
  EXPECT_EQ(loop(0.1, 1.1).gain, 0.0);
  // A hundred-thousandth beyond the boundary, and before it.
  EXPECT_EQ(loop(4.0 / 1.9 * (1.0 + 1e-5), 0.9).gain, 0.0);
  EXPECT_NEAR(loop(4.0 / 1.9 * (1.0 - 1e-5), 0.9).gain, 1.0 + 1e-5, 1e-9);
  EXPECT_EQ(margins_of([](ComplexDouble z) { return 1e308 * z / (1.0 - z); }).gain, 0.0);
  EXPECT_EQ(loop(2.2, 0.9).gain, 0.0);
  for (const double b : {0.01, 0.1, 1.0, 2.0}) {
    EXPECT_NEAR(loop(b, 0.9).gain, 4.0 / 1.9 / b, 1e-6 / b) << b;
  }
}

// Three sums and two leads need a least gain, which is found by scaling L until it is unstable.
TEST(Margins, CountAGainThatFalls) {
  const auto loop = [](double b) {
    return margins_of([=](ComplexDouble z) {
      const ComplexDouble lead = 1.0 - 0.9 * z, sum = 1.0 / (1.0 - z);
      return b * (z * lead * lead * sum * sum * sum);
    });
  };
  double low = 1e-6, high = 0.5;  // Unstable; stable.
  ASSERT_GT(loop(high).gain, 0.0);
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    (loop(middle).gain > 0.0 ? high : low) = middle;
  }
  // Growth counts from |z| = 1 + 1e-6 on: that is 5e-5 of the angle, 0.02, of the crossing.
  EXPECT_NEAR(loop(1.1 * high).gain, 1.1, 1e-4);
}

}  // namespace
}  // namespace proofmass
