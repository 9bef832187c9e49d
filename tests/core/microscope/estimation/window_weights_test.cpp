// Weights and variances of tests that lose data, against linear algebra with whole matrices and
// against the spectrum of the noise.

#include "core/microscope/estimation/ep_test/window_weights.hpp"

#include <Eigen/Dense>

#include "core/microscope/instrument/noise_config.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double window_s = 4.0;

std::vector<SensorNoise> noises() {
  return {NoiseConfig{}.linear_x,
          noise_preset(NoisePreset::flight_suref).linear_x,
          {.white_asd = 1e-12}};
}

/// That of sixteen windows and more: its rise ends at a line of its own.
std::vector<SensorNoise> noises_with_memory() {
  std::vector<SensorNoise> all = noises();
  all.push_back(NoiseConfig{}.linear_x);
  all.back().rise_corner_hz = 0.003;
  all.back().rise_limit_hz = 0.012;
  return all;
}

// r(n) = ∫ ½ S(f) |H(f)|² cos(2πfnτ) df up to the Nyquist frequency of the samples, with H the
// transfer function of a window. Steps of 2e-4 of f resolve the fastest cosine that counts.
double by_spectrum(const NoiseShape& shape, double distance) {
  double sum = 0.0;
  const double ratio = 1.0002;
  for (double f = 1e-9; f < 0.5 / period_s; f *= ratio) {
    const double block = std::sin(std::numbers::pi * f * window_s) /
                         (16.0 * std::sin(std::numbers::pi * f * period_s));
    const double gain = block * block * std::cos(std::numbers::pi * f * period_s);
    sum += 0.5 * shape.psd(f, period_s) * gain * gain *
           std::cos(2.0 * std::numbers::pi * f * distance * window_s) * f * std::log(ratio);
  }
  return sum;
}

TEST(WindowAutocovariance, IsThatOfTheSpectrum) {
  for (const SensorNoise& noise : noises_with_memory()) {
    const NoiseShape shape = shape_noise(noise, period_s);
    const WindowAutocovariance covariance(shape);
    const double variance = by_spectrum(shape, 0.0);
    for (const std::size_t distance : {0U, 1U, 2U, 3U, 10U, 15U, 16U, 20U, 400U}) {
      EXPECT_NEAR(covariance.at(distance), by_spectrum(shape, static_cast<double>(distance)),
                  2e-4 * variance)
          << noise.white_asd << " " << distance;
    }
  }
}

Eigen::MatrixXd covariance_matrix(const SensorNoise& noise, Eigen::Index size) {
  const WindowAutocovariance of(shape_noise(noise, period_s));
  Eigen::MatrixXd matrix(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      matrix(i, j) = of.at(static_cast<std::size_t>(std::abs(i - j)));
    }
  }
  return matrix;
}

// Generalised least squares of a constant has weights R⁻¹1. So R w is the same everywhere.
TEST(WindowWeights, AreBestForAConstantInEachStretch) {
  for (SensorNoise noise : noises()) {
    noise.pink_corner_hz = 0.0;
    const WindowWeights weights(noise, period_s);
    std::vector<bool> lost(120);
    lost[6] = lost[20] = lost[21] = true;
    const std::vector<float> found = weights.of(lost);
    ASSERT_EQ(found.size(), 119U);
    for (const std::size_t window : {5U, 6U, 19U, 20U, 21U}) EXPECT_EQ(found[window], 0.0F);
    for (const auto& [begin, end] : {std::pair{0, 5}, {7, 19}}) {
      const Eigen::Index size = end - begin;
      Eigen::VectorXd of_stretch(size);
      for (Eigen::Index i = 0; i < size; ++i) {
        of_stretch[i] = found[static_cast<std::size_t>(begin + i)];
      }
      const Eigen::VectorXd same = covariance_matrix(noise, size) * of_stretch;
      for (Eigen::Index i = 0; i < size; ++i) {
        // Weights are floats, and R amplifies their rounding by its condition, 1e3.
        EXPECT_NEAR(same[i] / same[0], 1.0, 1e-4) << noise.white_asd << " " << begin + i;
      }
    }
    EXPECT_NEAR(found[70], 1.0, 0.02);  // Far from an end, but for what a stretch of 32 has there.
    EXPECT_EQ(found[118], found[22]);
  }
}

TEST(WindowWeights, HaveTheNoiseThatWholeMatricesHave) {
  constexpr Eigen::Index size = 200;
  for (const SensorNoise& noise : noises_with_memory()) {
    std::vector<float> weights;
    std::vector<WindowRegressors> regressors;
    Eigen::MatrixXd x(size, 3), powers(size, 4);
    Eigen::VectorXd w(size);
    for (Eigen::Index i = 0; i < size; ++i) {
      weights.push_back(i % 17 < 4 ? 0.0F : 0.25F * static_cast<float>(i % 5));
      const double turn = 0.3 * static_cast<double>(i), t = 0.01 * static_cast<double>(i);
      regressors.push_back({8.0 * std::cos(turn), std::cos(0.1 * turn), std::sin(2.0 * turn)});
      for (Eigen::Index k = 0; k < 3; ++k) {
        x(i, k) = regressors.back()[static_cast<std::size_t>(k)];
      }
      powers.row(i) << 1.0, t, t * t, t * t * t;
      w[i] = weights.back();
    }
    const Eigen::MatrixXd rest = x - powers * (powers.transpose() * w.asDiagonal() * powers)
                                                  .ldlt()
                                                  .solve(powers.transpose() * w.asDiagonal() * x);
    const Eigen::MatrixXd z = w.asDiagonal() * rest;
    const Eigen::MatrixXd expected = z.transpose() * covariance_matrix(noise, size) * z;
    const RegressorProducts found =
        WindowWeights(noise, period_s).noise_products(weights, regressors);
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = 0; j < 3; ++j) {
        EXPECT_NEAR(found[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)], expected(i, j),
                    1e-8 * std::sqrt(expected(i, i) * expected(j, j)));
      }
    }
  }
}

}  // namespace
}  // namespace proofmass
