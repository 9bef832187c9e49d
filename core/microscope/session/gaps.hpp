#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/microscope/session/session.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// m cos(2π f t + φ): how a rate follows a frequency; t = 0 at the session's start.
struct RateModulation {
  double depth = 0.0;  ///< m, in [0, 1].
  double phase_rad = 0.0;
};

/// What sessions that test lose of their data: `[gaps]` of a campaign file. Nothing by default.
struct GapsConfig {
  /// λ0 of glitches, which come at λ(t) = λ0 (1 + Σ m cos(2π f t + φ)) ≥ 0; 0 for none.
  double glitch_rate_hz = 0.0;
  double glitch_duration_s = 15.0;  ///< Discarded from each glitch on.
  RateModulation orbital{};         ///< f = f_orb.
  RateModulation spin{};            ///< f = f_spin; none in inertial pointing.
  RateModulation test{};            ///< f = f_EP.
  double telemetry_rate_hz = 0.0;   ///< Of gaps in the telemetry; 0 for none.
  double telemetry_duration_s = 600.0;

  [[nodiscard]] bool lose_data() const { return glitch_rate_hz > 0.0 || telemetry_rate_hz > 0.0; }

  /// Checks what has to hold between several values.
  /// @throws ConfigError naming the field, its value and the rule.
  void validate(double sample_period_s) const;
};

/// Which blocks of test_block_size samples of a session's record have a sample that is lost. A pure
/// function of its arguments; glitches and telemetry draw from streams of their own,
/// `session/NAME/glitches` and `session/NAME/telemetry`.
///
/// @param seed  Of the campaign.
/// @pre gaps.validate() passed.
[[nodiscard]] std::vector<bool> lost_blocks(const GapsConfig& gaps, const Session& session,
                                            std::uint64_t seed, RunIndex run,
                                            std::size_t num_blocks, double orbit_period_s,
                                            double sample_period_s);

/// The part of a session's samples that is left, in the mean over runs. Nothing begins within the
/// duration d before a sample with the probability exp(−∫λ dt), and the mean of a modulation over
/// that time is m sin(πfd)/(πfd) cos(2πf(t − d/2) + φ).
[[nodiscard]] double kept_part(const GapsConfig& gaps, const Session& session,
                               double orbit_period_s);

}  // namespace proofmass
