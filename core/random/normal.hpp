#pragma once

#include <array>

#include "core/random/stream.hpp"

namespace proofmass {

/// Four independent standard normal deviates from one block, by [BoxMuller1958] in single
/// precision.
///
/// Noise of a sensor needs no 53 bits: the deviates have 24-bit mantissas, their magnitude is at
/// most 6.66, which a true normal exceeds once in 4e10 samples, and their moments and tails agree
/// with the normal law's within the resolution of 4e8 samples.
[[nodiscard]] std::array<float, 4> normal_deviates(const RandomBlock& block);

/// x with Φ(x) = probability, for 0 < probability < 1 [Wichura1988] (algorithm AS 241, PPND16);
/// relative error below 1e-15, so monotone down to that. One uniform to one normal: for drawn
/// parameters.
[[nodiscard]] double inverse_normal(double probability);

}  // namespace proofmass
