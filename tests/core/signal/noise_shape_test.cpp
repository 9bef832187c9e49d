#include "core/signal/noise_shape.hpp"

#include <Eigen/Dense>

#include "core/microscope/campaign/scenario.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double sample_period_s = 0.25;

struct NamedNoise {
  std::string name;
  SensorNoise noise;
};

std::vector<NamedNoise> preset_channels() {
  const NoiseConfig design = noise_preset(NoisePreset::design_2013);
  const NoiseConfig flight = noise_preset(NoisePreset::flight_suref);
  return {{"design X", design.linear_x},      {"design YZ", design.linear_yz},
          {"design angular", design.angular}, {"flight X", flight.linear_x},
          {"flight YZ", flight.linear_yz},    {"flight angular", flight.angular}};
}

/// Twenty frequencies a decade from 2e-5 Hz up.
std::vector<double> frequencies_up_to(double highest_hz) {
  std::vector<double> frequencies;
  for (double f = 2e-5; f < highest_hz; f *= std::pow(10.0, 0.05)) frequencies.push_back(f);
  frequencies.push_back(highest_hz);
  return frequencies;
}

double decibels(double ratio) { return 10.0 * std::log10(ratio); }

void expect_shape_follows(const SensorNoise& noise, double tolerance_db, const std::string& name) {
  const NoiseShape shape = shape_noise(noise, sample_period_s);
  for (const double f : frequencies_up_to(1.0)) {
    EXPECT_NEAR(decibels(shape.psd(f, sample_period_s) / nominal_psd(noise, f)), 0.0, tolerance_db)
        << name << " at " << f << " Hz";
  }
}

// [Hardy2013] section 5.1 as the model states it: X at 0.01 Hz, by hand.
TEST(NominalPsd, IsTheSumOfWhitePinkAndRise) {
  const SensorNoise design{1.4e-12, 2.7e-4, 1.4e-12, 0.03, 0.0};
  const double expected = 1.96e-24 * (1.0 + 0.027 + 1.0 / 81.0);
  EXPECT_NEAR(nominal_psd(design, 0.01) / expected, 1.0, 1e-14);
  const SensorNoise limited{1.0, 0.0, 2.0, 0.1, 0.2};  // 1 + 4·2⁴/(1 + 1) at 0.2 Hz
  EXPECT_NEAR(nominal_psd(limited, 0.2), 33.0, 1e-13);
}

bool is_finite(const NoiseShape& shape) {
  const auto are_finite = [](const auto& values) {
    return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
  };
  return std::isfinite(shape.gain) && are_finite(shape.pole) && are_finite(shape.coefficient) &&
         std::isfinite(norm(shape.pair_pole)) && std::isfinite(norm(shape.pair_coefficient)) &&
         are_finite(shape.start_factor);
}

// Whatever noise a scenario admits, up to the corners of its ranges, has a filter.
TEST(NoiseShape, IsFiniteForEveryNoiseThatAScenarioAdmits) {
  std::mt19937_64 random(1);
  const auto exponential = [&](double lowest, double highest) {  // The ends, too.
    const double x = std::uniform_real_distribution<>(-0.1, 1.1)(random);
    return lowest * std::pow(highest / lowest, std::clamp(x, 0.0, 1.0));
  };
  for (int i = 0; i < 10000; ++i) {
    Scenario scenario;
    SensorNoise& noise = scenario.noise.angular;
    noise.white_asd = exponential(1.001e-100, 0.999e100);
    noise.pink_corner_hz = i % 5 == 0 ? 0.0 : exponential(1e-300, 0.0999);
    noise.rise_asd = i % 7 == 0 ? 0.0 : noise.white_asd * exponential(1.001e-12, 0.999e12);
    noise.rise_corner_hz = exponential(1.001e-3, 0.999);
    noise.rise_limit_hz = i % 3 == 0 ? 0.0 : exponential(1.001e-6, 0.599);
    ASSERT_NO_THROW(scenario.validate());
    if (i % 2 == 0) noise.pink_corner_hz = exponential(0.1, 50.0);  // A wire's.
    EXPECT_TRUE(is_finite(shape_noise(noise, exponential(0.05, 1.0)))) << i;
  }
}

// Half a decibel is promised; the ripple of the sum, 0.155 dB, is all that there is of it.
TEST(NoiseShape, FollowsTheNominalSpectrumOfEveryPreset) {
  for (const auto& [name, noise] : preset_channels()) expect_shape_follows(noise, 0.17, name);
}

TEST(NoiseShape, FollowsPinkAlone) {
  for (const double corner_hz : {1e-5, 1e-4, 1e-3, 0.01, 0.1}) {
    expect_shape_follows({1.0, corner_hz, 0.0, 0.03, 0.0}, 0.17, "pink");
  }
}

// A wire's noise may be 1/f far above what samples can tell. At a tenth of the sample rate the
// filter's 4 sin²(πfT) is 3.3 % or 0.14 dB less than (2πfT)², beside the ripple of 0.155 dB.
TEST(NoiseShape, FollowsAWireAtEverySamplePeriod) {
  for (const double period_s : {0.05, 0.2, 0.25, 0.3, 0.5, 1.0}) {
    for (const double corner_hz : {0.9, 9.0, 50.0}) {
      const SensorNoise noise{1.0, corner_hz, 0.0, 0.03, 0.0};
      const NoiseShape shape = shape_noise(noise, period_s);
      for (const double f : frequencies_up_to(0.1 / period_s)) {
        EXPECT_NEAR(decibels(shape.psd(f, period_s) / nominal_psd(noise, f)), 0.0, 0.295)
            << corner_hz << " Hz, a sample each " << period_s << " s, at " << f << " Hz";
      }
    }
  }
}

TEST(NoiseShape, FollowsTheRiseAlone) {
  expect_shape_follows({1.0, 0.0, 1.0, 0.03, 0.0}, 0.07, "rise");
  expect_shape_follows({1.0, 0.0, 1.0, 0.02, 0.06}, 0.07, "limited rise");
}

// One-sided density A² over [0, 1/2T]: variance A²/2T, no state.
TEST(NoiseShape, OfWhiteNoiseIsOneGain) {
  const NoiseShape shape = shape_noise({3.0, 0.0, 0.0, 0.03, 0.0}, sample_period_s);
  EXPECT_EQ(shape.num_states(), 0U);
  EXPECT_NEAR(shape.gain, 3.0 * std::sqrt(2.0), 1e-15);
  EXPECT_NEAR(shape.psd(0.1, sample_period_s), 9.0, 1e-14);
}

/// The parallel form as s ← A s + u w, y = g w + c s.
struct StateSpace {
  Eigen::MatrixXd transition;
  Eigen::VectorXd input, output;
};

StateSpace state_space(const NoiseShape& shape) {
  const auto n = static_cast<Eigen::Index>(shape.num_states());
  StateSpace system{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Ones(n), Eigen::VectorXd(n)};
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(shape.num_real); ++i) {
    system.transition(i, i) = shape.pole[static_cast<std::size_t>(i)];
    system.output(i) = shape.coefficient[static_cast<std::size_t>(i)];
  }
  if (!shape.has_pair) return system;
  const double re = shape.pair_pole.real();
  const double im = shape.pair_pole.imag();
  system.transition.bottomRightCorner<2, 2>() << re, -im, im, re;
  system.input(n - 1) = 0.0;  // w is real.
  system.output.tail<2>() << 2.0 * shape.pair_coefficient.real(),
      -2.0 * shape.pair_coefficient.imag();
  return system;
}

Eigen::MatrixXd start_covariance(const NoiseShape& shape) {
  const auto n = static_cast<Eigen::Index>(shape.num_states());
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>
      factor(shape.start_factor.data(), n, n);
  return factor * factor.transpose();
}

// One step leaves the covariance of the start as it is: P = A P Aᵀ + u uᵀ. P reaches 1/(1 − p²) =
// 5e4, whose rounding is 1e-11 of the drive's unit variance.
TEST(NoiseShape, StartIsStationary) {
  for (const auto& [name, noise] : preset_channels()) {
    const NoiseShape shape = shape_noise(noise, sample_period_s);
    const StateSpace system = state_space(shape);
    const Eigen::MatrixXd start = start_covariance(shape);
    const Eigen::MatrixXd next = system.transition * start * system.transition.transpose() +
                                 system.input * system.input.transpose();
    EXPECT_LT((next - start).cwiseAbs().maxCoeff(), 1e-9) << name;
  }
}

// The spectrum of the state space, solved as a linear system, is that of the parallel form.
TEST(NoiseShape, PsdIsThatOfItsStates) {
  for (const auto& [name, noise] : preset_channels()) {
    const NoiseShape shape = shape_noise(noise, sample_period_s);
    const StateSpace system = state_space(shape);
    for (const double f : frequencies_up_to(2.0)) {
      const std::complex<double> z = std::polar(1.0, 2.0 * std::numbers::pi * f * sample_period_s);
      const Eigen::MatrixXcd resolvent =
          z * Eigen::MatrixXcd::Identity(system.transition.rows(), system.transition.cols()) -
          system.transition.cast<std::complex<double>>();
      const Eigen::VectorXcd states =
          resolvent.partialPivLu().solve(system.input.cast<std::complex<double>>());
      const std::complex<double> response =
          shape.gain + (system.output.cast<std::complex<double>>().transpose() * states)(0);
      EXPECT_NEAR(std::norm(response) * 2.0 * sample_period_s / shape.psd(f, sample_period_s), 1.0,
                  1e-8)
          << name << " at " << f << " Hz";
    }
  }
}

}  // namespace
}  // namespace proofmass
