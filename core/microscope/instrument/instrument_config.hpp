#pragma once

#include <array>

namespace proofmass {

/// Settings of the sensors that all runs share: `[sensor]` of a campaign file.
struct SensorConfig {
  /// Largest acceleration that a sensor reports on an axis, m/s²; a larger one reads as this.
  double range_m_s2 = 1e-5;
  /// Place of the unit: the vector in S from O_sat to where the midpoint of O_1 and O_2 is without
  /// the offset that is drawn, r_c = position + drawn offset.
  std::array<double, 3> position_m{};
  /// k_k/m_k of each sensor along its axes Y and Z, s⁻²: see stiffness.hpp.
  std::array<double, 2> radial_stiffness_s2{};
};

/// A draw outside these bounds is drawn again.
struct AcceptanceConfig {
  double a_d11_max = 1e-2;
  double a_d1j_max_rad = 1.6e-3;  ///< |a_d12| and |a_d13|.
  double a_c1j_max_rad = 2.6e-3;  ///< |a_c12| and |a_c13|.
};

}  // namespace proofmass
