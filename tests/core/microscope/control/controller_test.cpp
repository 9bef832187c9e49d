#include "core/microscope/control/controller.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

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

using Roots = std::vector<std::complex<double>>;

Roots sampled(const Roots& roots, double period_s) {
  Roots sampled;
  for (const auto& root : roots) {
    sampled.push_back((2.0 / period_s + root) / (2.0 / period_s - root));
  }
  return sampled;
}

/// Coefficients of Π (z − root), the highest power first.
std::vector<std::complex<double>> polynomial(const Roots& roots) {
  std::vector<std::complex<double>> coefficients{1.0};
  for (const auto& root : roots) {
    coefficients.push_back(0.0);
    for (std::size_t i = coefficients.size() - 1; i > 0; --i) {
      coefficients[i] -= root * coefficients[i - 1];
    }
  }
  return coefficients;
}

/// Largest |z| of what a loop z⁻¹ C(z) leaves, from its characteristic polynomial z D(z) + N(z).
double largest_root(const ControllerConfig& config, double period_s) {
  Roots zeros = sampled(config.zeros_rad_s, period_s);
  zeros.resize(config.poles_rad_s.size(), -1.0);
  std::complex<double> gain = config.gain;
  for (const auto& zero : config.zeros_rad_s) gain *= 2.0 / period_s - zero;
  for (const auto& pole : config.poles_rad_s) gain /= 2.0 / period_s - pole;
  auto characteristic = polynomial(sampled(config.poles_rad_s, period_s));
  characteristic.push_back(0.0);
  const auto numerator = polynomial(zeros);
  for (std::size_t i = 0; i < numerator.size(); ++i) characteristic[i + 1] += gain * numerator[i];
  const auto order = static_cast<Eigen::Index>(characteristic.size()) - 1;
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(order, order);
  companion.diagonal(-1).setOnes();
  for (Eigen::Index i = 0; i < order; ++i) {
    companion(0, i) = -(characteristic[static_cast<std::size_t>(i) + 1] / characteristic[0]).real();
  }
  return companion.eigenvalues().cwiseAbs().maxCoeff();
}

/// A loop with two integrators, and a resonance of the controller that zeros of some damping follow
/// at once.
ControllerConfig resonant(double rad_s, double damping, double gain) {
  const std::complex<double> zero{-damping * rad_s, rad_s * std::sqrt(1.0 - damping * damping)};
  return {.gain = gain,
          .zeros_rad_s = {-0.0314159, zero, std::conj(zero)},
          .poles_rad_s = {0.0, 0.0, {0.0, rad_s}, {0.0, -rad_s}}};
}

// Pole and zero together turn L by a whole turn, between two angles of any grid.
TEST(Margins, SeeAResonanceOfTheController) {
  constexpr double period_s = 0.25;
  const auto margins = [&](const ControllerConfig& config) {
    const SampledController controller(config, period_s);
    return margins_of([&](ComplexDouble z) { return z * controller.response(z); },
                      controller.resonances());
  };
  int num_stable = 0, num_unstable = 0;
  for (const double rad_s : {0.3, 0.5, 1.0, 1.7, 2.0, 2.5, 3.0, 3.5}) {
    for (const double damping : {-0.01, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1}) {
      const ControllerConfig config = resonant(rad_s, damping, 0.3);
      const bool is_stable = largest_root(config, period_s) < 1.0;
      ++(is_stable ? num_stable : num_unstable);
      const Margins found = margins(config);
      EXPECT_EQ(found.gain > 0.0, is_stable) << rad_s << ' ' << damping;
      if (!is_stable) continue;
      const auto grows_by = [&](double factor) {
        return largest_root(resonant(rad_s, damping, 0.3 * factor), period_s) > 1.0 + 1e-10;
      };
      const double inside = 0.99 * found.gain, beyond = 1.1 * found.gain;
      EXPECT_FALSE(grows_by(inside) || grows_by(1.0 / inside)) << rad_s << ' ' << damping;
      EXPECT_TRUE(grows_by(beyond) || grows_by(1.0 / beyond)) << rad_s << ' ' << damping;
    }
  }
  EXPECT_GT(std::min(num_stable, num_unstable), 15);
}

}  // namespace
}  // namespace proofmass
