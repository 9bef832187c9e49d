#pragma once

namespace proofmass {

/// x with Φ(x) = probability, for 0 < probability < 1 [Wichura1988] (algorithm AS 241, PPND16);
/// relative error below 1e-15, so monotone down to that. One uniform to one normal: for drawn
/// parameters.
[[nodiscard]] double inverse_normal(double probability);

}  // namespace proofmass
