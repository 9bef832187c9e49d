#pragma once

namespace proofmass {

/// The orbit of the satellite about the Earth: `[orbit]` of a campaign file.
struct OrbitConfig {
  double period_s = 5950.0;
  double eccentricity = 5e-3;  ///< In [0, 0.5].
};

}  // namespace proofmass
