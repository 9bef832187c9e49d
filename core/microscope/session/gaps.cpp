#include "core/microscope/session/gaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/random/stream.hpp"

namespace proofmass {
namespace {

// Mean number of losses that touch a window. exp(−2), a seventh of the windows, are left.
constexpr double touches_max = 2.0;

/// Loses what follows each event of a Poisson process: events at the highest rate, of which one at
/// t is kept with the probability rate_hz(t)/highest_hz. They begin early enough to reach into the
/// record.
///
/// @param lost  Blocks of the record, each of block_s.
template <typename Rate>
void lose_after_events(const RandomStream& stream, double highest_hz, const Rate& rate_hz,
                       double duration_s, double block_s, std::vector<bool>& lost) {
  if (highest_hz == 0.0) return;
  double time_s = -duration_s;
  for (std::uint32_t i = 0;; i += 2) {
    time_s -= logarithm(uniform(stream.block(i))) / highest_hz;
    if (time_s >= static_cast<double>(lost.size()) * block_s) return;
    if (uniform(stream.block(i + 1)) * highest_hz >= rate_hz(time_s)) continue;
    auto block = static_cast<std::size_t>(std::max(time_s / block_s, 0.0));
    for (; block < lost.size() && static_cast<double>(block) * block_s < time_s + duration_s;
         ++block) {
      lost[block] = true;
    }
  }
}

/// λ(t)/λ0, or its mean over a time with the middle t.
double relative_rate(const GapsConfig& gaps, const Session& session, double orbit_period_s,
                     double time_s, double over_s = 0.0) {
  const auto modulation = [&](const RateModulation& of, double frequency_hz) {
    const double turns = frequency_hz * time_s + of.phase_rad / (2.0 * std::numbers::pi);
    const double half_rad = std::numbers::pi * frequency_hz * over_s;
    const double smoothing = half_rad > 0.0 ? sincos(half_rad).sine / half_rad : 1.0;
    return of.depth * sincos_turns(turns).cosine * smoothing;
  };
  const double spin_hz = std::abs(session.spin_rate_rad_s) / (2.0 * std::numbers::pi);
  double relative = 1.0 + modulation(gaps.orbital, 1.0 / orbit_period_s) +
                    modulation(gaps.test, test_frequency_hz(session, orbit_period_s));
  if (spin_hz > 0.0) relative += modulation(gaps.spin, spin_hz);
  return relative;
}

}  // namespace

void GapsConfig::validate(double sample_period_s) const {
  const double depth = orbital.depth + spin.depth + test.depth;
  if (depth > 1.0) {
    const std::array depths{std::pair("orbital", orbital.depth), std::pair("spin", spin.depth),
                            std::pair("test", test.depth)};
    const auto [name, largest] =
        *std::ranges::max_element(depths, {}, [](auto of) { return of.second; });
    throw ConfigError(fmt::format("gaps.{}_modulation", name), fmt::format("{}", largest),
                      fmt::format("must be at most 1 with the other modulations, not {:.6g}, as no "
                                  "rate is below 0",
                                  depth));
  }
  const double window_s = 2.0 * static_cast<double>(test_block_size) * sample_period_s;
  const double of_glitches = glitch_rate_hz * (glitch_duration_s + window_s);
  const double of_telemetry = telemetry_rate_hz * (telemetry_duration_s + window_s);
  const double touches = of_glitches + of_telemetry;
  if (touches > touches_max) {
    const bool are_glitches = of_glitches >= of_telemetry;
    throw ConfigError(are_glitches ? "gaps.glitch_rate_hz" : "gaps.telemetry_rate_hz",
                      fmt::format("{}", are_glitches ? glitch_rate_hz : telemetry_rate_hz),
                      fmt::format("must leave more than a seventh of the windows of {} s: {:.6g} "
                                  "losses touch one, and may be {}",
                                  window_s, touches, touches_max));
  }
}

std::vector<bool> lost_blocks(const GapsConfig& gaps, const Session& session, std::uint64_t seed,
                              RunIndex run, std::size_t num_blocks, double orbit_period_s,
                              double sample_period_s) {
  std::vector<bool> lost(num_blocks);
  const double block_s = static_cast<double>(test_block_size) * sample_period_s;
  const auto stream = [&](std::string_view name) {
    return RandomStream(seed, run, stream_id(fmt::format("session/{}/{}", session.name, name)));
  };
  const auto glitch_rate_hz = [&](double time_s) {
    return gaps.glitch_rate_hz * relative_rate(gaps, session, orbit_period_s, time_s);
  };
  const double depth = gaps.orbital.depth + gaps.spin.depth + gaps.test.depth;
  lose_after_events(stream("glitches"), gaps.glitch_rate_hz * (1.0 + depth), glitch_rate_hz,
                    gaps.glitch_duration_s, block_s, lost);
  lose_after_events(
      stream("telemetry"), gaps.telemetry_rate_hz, [&](double) { return gaps.telemetry_rate_hz; },
      gaps.telemetry_duration_s, block_s, lost);
  return lost;
}

double kept_part(const GapsConfig& gaps, const Session& session, double orbit_period_s) {
  constexpr int num_times = 4099;  // A prime: no period of a session is one of them.
  const double duration_s = session.num_orbits * orbit_period_s, over_s = gaps.glitch_duration_s;
  double sum = 0.0;
  for (int i = 0; i < num_times; ++i) {
    const double time_s = duration_s * i / num_times;
    sum += exponential(-gaps.glitch_rate_hz * over_s *
                       relative_rate(gaps, session, orbit_period_s, time_s - 0.5 * over_s, over_s));
  }
  return sum / num_times * exponential(-gaps.telemetry_rate_hz * gaps.telemetry_duration_s);
}

}  // namespace proofmass
