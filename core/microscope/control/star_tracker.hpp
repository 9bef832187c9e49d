#pragma once

#include <Eigen/Core>
#include <array>

#include "core/microscope/instrument/noise_config.hpp"

namespace proofmass {

/// Two heads with orthogonal boresights (0, ±√½, √½) in S, fused by inverse covariance.
struct StarTracker {
  Eigen::Matrix3d
      noise_factor_S_rad;  ///< Lower triangular; times three unit normals: a sample's noise, rad.
  std::array<Eigen::Matrix3d, 2> weight;  ///< Of each head in the fused angles; they sum to 1.

  /// Bias of the fused angles, rad, from that of each head in S.
  [[nodiscard]] Eigen::Vector3d fused_bias_S(
      const std::array<Eigen::Vector3d, 2>& head_bias_S) const;
};

[[nodiscard]] StarTracker make_star_tracker(const NoiseConfig& noise, double sample_period_s);

}  // namespace proofmass
