#pragma once

namespace proofmass {

/// Settings that are the same for all sensors: `[sensor]` of a campaign file.
struct SensorConfig {
  /// Largest acceleration that a sensor reports on an axis, m/s²; a larger one reads as this.
  double range_m_s2 = 1e-5;
};

/// A draw outside these bounds is drawn again.
struct AcceptanceConfig {
  double a_d11_max = 1e-2;
  double a_d1j_max_rad = 1.6e-3;  ///< |a_d12| and |a_d13|.
  double a_c1j_max_rad = 2.6e-3;  ///< |a_c12| and |a_c13|.
};

}  // namespace proofmass
