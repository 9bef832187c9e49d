#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/math/complex.hpp"
#include "core/microscope/session/test_signals.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {

// How much the windows of a test count, and the variance that this makes. README.md derives both.

/// Autocovariance, (m/s²)², of half the difference of two sensors' noise, averaged over windows.
struct WindowAutocovariance {
  /// Re(weight·factorⁿ) at a distance of n windows, in addition to `near`: the long memory of 1/f
  /// noise, and of a rise that ends at a few mHz.
  struct Memory {
    ComplexDouble weight, factor;
  };
  static constexpr std::size_t num_near = 16;
  std::array<double, num_near> near{};  ///< At a distance of n windows.
  std::vector<Memory> memory;

  explicit WindowAutocovariance(const NoiseFilter& sensor);
  [[nodiscard]] double at(std::size_t distance) const;
  /// Over all distances, of either sign.
  [[nodiscard]] double sum() const;
};

/// For all runs of a campaign.
class WindowWeights {
 public:
  /// @param sensor  Noise of a sensor along X.
  WindowWeights(const SensorNoise& sensor, double sample_period_s);

  /// The weight of each window: that of generalised least squares of a constant over the stretch of
  /// windows without a loss in which it lies, 1 far from its ends; 0 if the window has lost data.
  /// @param lost_blocks  A window consists of two neighbours of these.
  [[nodiscard]] std::vector<float> of(const std::vector<bool>& lost_blocks) const;

  /// XᵀW R W X, with R the covariance of the windows' noise and X what is left of the regressors
  /// when their least-squares polynomial of third degree, with these weights, is taken away.
  [[nodiscard]] RegressorProducts noise_products(
      std::span<const float> weights, std::span<const WindowRegressors> regressors) const;

 private:
  WindowAutocovariance noise_;
  /// Of stretches of 1, 2, ... windows: the weights of the first half, the middle one included.
  std::vector<std::vector<float>> of_stretches_;
};

}  // namespace proofmass
