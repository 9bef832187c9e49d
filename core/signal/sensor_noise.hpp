#pragma once

namespace proofmass {

/// One-sided PSD white²·(1 + f_p/f) + rise²·(f/f_r)⁴ / (1 + (f/f_l)⁴); no limit if f_l = 0.
struct SensorNoise {
  double white_asd = 0.0;  ///< unit/√Hz.
  double pink_corner_hz = 0.0;
  double rise_asd = 0.0;  ///< unit/√Hz; 0 for no rise.
  double rise_corner_hz = 0.03;
  double rise_limit_hz = 0.0;
};

}  // namespace proofmass
