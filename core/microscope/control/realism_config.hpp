#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace proofmass {

/// What the paper's simulator leaves out: `[realism]` of a campaign file. Each term is off at 0 and
/// has its equation in core/microscope/simulation/realism.hpp.
struct RealismConfig {
  double star_tracker_orbital_error_rad = 0.0;    ///< A: about each axis of S, at f_orb.
  double star_tracker_orbital_phase_rad = 0.0;    ///< φ.
  std::int64_t star_tracker_latency_samples = 0;  ///< m: its angles are as old as that.

  double thrust_limit_m_s2 = 0.0;  ///< Of an axis; 0: none.
  double thrust_quantum_m_s2 = 0.0;
  double torque_limit_rad_s2 = 0.0;  ///< As an angular acceleration about an axis; 0: none.
  double torque_quantum_rad_s2 = 0.0;
  double actuation_lag_s = 0.0;  ///< τ of thrust and torque.

  double mass_kg = 0.0;                            ///< m of the satellite.
  std::array<double, 3> inertia_kg_m2{};           ///< Diagonal of [J] in S.
  std::array<double, 3> inertia_products_kg_m2{};  ///< J_xy, J_xz, J_yz: elements of [J].
  std::array<double, 3> thrust_arm_m{};            ///< d: from O_sat to the thrust's line, in S.

  std::array<double, 2> angular_scale_error{};  ///< ε of the angular measurement of each sensor.
  double angular_alignment = 0.0;  ///< λ: the part of a sensor's misalignment that it has; 1: all.

  std::array<double, 2> bias_drift_m_s3{};    ///< Of each sensor's read-out bias, every axis.
  std::array<double, 2> scale_drift_per_s{};  ///< Of each sensor's scale factors.

  /// Whether [J] is given; without it the satellite turns as it is commanded.
  [[nodiscard]] bool has_inertia() const { return inertia_kg_m2[0] > 0.0; }
  [[nodiscard]] Eigen::Matrix3d inertia_tensor_kg_m2() const;

  /// e^(−T/τ): what is left of the distance to a command after a sample.
  [[nodiscard]] double actuation_memory(double sample_period_s) const;

  /// @throws ConfigError if [J] is no tensor of inertia, or a term lacks what it needs.
  void validate() const;
};

}  // namespace proofmass
