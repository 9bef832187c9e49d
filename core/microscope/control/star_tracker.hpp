#pragma once

#include <Eigen/Core>
#include <array>

#include "core/microscope/instrument/noise_config.hpp"

namespace proofmass {

/// A star tracker of two heads with orthogonal boresights (0, ±√½, √½) in S, fused by inverse
/// covariance. Each head is precise across its boresight and poor about it, and together they are
/// precise about all three axes.
struct StarTracker {
  /// Lower triangular factor L of the covariance L Lᵀ of a sample's fused angles at noise.scale =
  /// 1: L times three independent standard normal deviates is the noise of a sample, rad.
  Eigen::Matrix3d noise_factor_S_rad;
  std::array<Eigen::Matrix3d, 2> weight;  ///< Of each head in the fused angles; they sum to 1.

  /// Bias of the fused angles, rad.
  /// @param head_bias_S  Rotation vector of each head's bias, rad.
  [[nodiscard]] Eigen::Vector3d fused_bias_S(
      const std::array<Eigen::Vector3d, 2>& head_bias_S) const;
};

/// @param noise  Of which the two densities of a head are used, and not the scale.
[[nodiscard]] StarTracker make_star_tracker(const NoiseConfig& noise, double sample_period_s);

}  // namespace proofmass
