// What tests lose, against the law that it is to follow.

#include "core/microscope/session/gaps.hpp"

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double orbit_s = 5950.0, sample_s = 0.25, block_s = 4.0;
constexpr std::size_t num_blocks = 14875;  // Ten orbits.

Session spinning_test() {
  Session session;
  session.name = "ep";
  session.target = SessionTarget::ep_test;
  session.spin_rate_rad_s = 2.0 * std::numbers::pi * 4.5 / orbit_s;
  return session;
}

std::vector<bool> lost(const GapsConfig& gaps, std::uint64_t run, std::uint64_t seed = 1,
                       const Session& session = spinning_test()) {
  return lost_blocks(gaps, session, seed, RunIndex{run}, num_blocks, orbit_s, sample_s);
}

TEST(Gaps, AreNoneByDefault) { EXPECT_EQ(std::ranges::count(lost({}, 0), true), 0); }

// A block is kept if no event falls into it or into the duration before.
TEST(Gaps, LoseThePartThatAPoissonProcessDoes) {
  for (const bool is_telemetry : {false, true}) {
    GapsConfig gaps;
    (is_telemetry ? gaps.telemetry_rate_hz : gaps.glitch_rate_hz) = 0.01;
    (is_telemetry ? gaps.telemetry_duration_s : gaps.glitch_duration_s) = 20.0;
    double num_lost = 0.0;
    constexpr int num_runs = 40;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      num_lost += static_cast<double>(std::ranges::count(lost(gaps, run), true));
    }
    const double part = 1.0 - std::exp(-0.01 * (20.0 + block_s));
    // Blocks less than 24 s apart are lost together: at most 2·6 share one event.
    const double sigma = std::sqrt(12.0 * part * (1.0 - part) / (num_runs * num_blocks));
    EXPECT_NEAR(num_lost / (num_runs * num_blocks), part, 4.0 * sigma) << is_telemetry;
  }
}

// e^(−λd (1 + a cos x)) has the mean e^(−λd) I₀(λd a), and I₀ of two modulations of unrelated
// phases is a product; f_EP and the spin are both whole multiples of half of f_orb. What is lost is
// counted, too.
TEST(Gaps, KeepThePartThatBesselsFunctionTells) {
  GapsConfig gaps;
  gaps.glitch_rate_hz = 0.06;
  gaps.glitch_duration_s = 20.0;
  Session session = spinning_test();
  session.num_orbits = 10;
  const auto amplitude = [](double depth, double frequency_hz) {
    const double half_rad = std::numbers::pi * frequency_hz * 20.0;
    return 1.2 * depth * std::sin(half_rad) / half_rad;
  };
  EXPECT_NEAR(kept_part(gaps, session, orbit_s), std::exp(-1.2), 1e-12);
  gaps.test.depth = 0.5;
  double expected = std::exp(-1.2) * std::cyl_bessel_i(0.0, amplitude(0.5, 5.5 / orbit_s));
  EXPECT_NEAR(kept_part(gaps, session, orbit_s), expected, 1e-3);
  gaps.spin.depth = 0.5;
  expected *= std::cyl_bessel_i(0.0, amplitude(0.5, 4.5 / orbit_s));
  EXPECT_NEAR(kept_part(gaps, session, orbit_s), expected, 1e-3);
  gaps.telemetry_rate_hz = 1e-3;
  gaps.telemetry_duration_s = 100.0;
  EXPECT_NEAR(kept_part(gaps, session, orbit_s), expected * std::exp(-0.1), 1e-3);
}

/// Amplitude of the lost blocks at a frequency over their mean; cosine and sine.
std::array<double, 2> relative_amplitude(const GapsConfig& gaps, double frequency_hz,
                                         double& sigma) {
  double num_lost = 0.0, cosine = 0.0, sine = 0.0;
  for (std::uint64_t run = 0; run < 200; ++run) {
    const std::vector<bool> blocks = lost(gaps, run);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (!blocks[i]) continue;
      // An event comes half a block and half of its duration before the middle, in the mean.
      const double time_s = (static_cast<double>(i) + 0.5) * block_s - 0.5;
      const double angle = 2.0 * std::numbers::pi * frequency_hz * time_s;
      num_lost += 1.0;
      cosine += 2.0 * std::cos(angle);
      sine += 2.0 * std::sin(angle);
    }
  }
  sigma = std::sqrt(2.0 * 2.0 / num_lost);  // An event may lose two blocks.
  return {cosine / num_lost, sine / num_lost};
}

TEST(Gaps, FollowTheOrbitTheSpinAndTheDirectionOfTheEarth) {
  for (int which = 0; which < 3; ++which) {
    GapsConfig gaps;
    gaps.glitch_rate_hz = 1e-3;
    gaps.glitch_duration_s = 1.0;
    RateModulation* const all[] = {&gaps.orbital, &gaps.spin, &gaps.test};
    *all[which] = {.depth = 0.8, .phase_rad = 0.5};
    const double turns[] = {1.0, 4.5, 5.5};
    for (int line = 0; line < 3; ++line) {
      double sigma = 0.0;
      const auto [cosine, sine] = relative_amplitude(gaps, turns[line] / orbit_s, sigma);
      // cos(ωt + φ) = cos φ cos ωt − sin φ sin ωt. Of five events in a thousand one hides another.
      const double depth = line == which ? 0.8 : 0.0;
      EXPECT_NEAR(cosine, depth * std::cos(0.5), 4.0 * sigma + 0.005) << which << line;
      EXPECT_NEAR(sine, -depth * std::sin(0.5), 4.0 * sigma + 0.005) << which << line;
    }
  }
}

TEST(Gaps, AreThoseOfSeedRunAndSession) {
  GapsConfig gaps;
  gaps.glitch_rate_hz = 0.01;
  Session other = spinning_test();
  other.name = "other";
  EXPECT_EQ(lost(gaps, 3), lost(gaps, 3));
  EXPECT_NE(lost(gaps, 3), lost(gaps, 4));
  EXPECT_NE(lost(gaps, 3), lost(gaps, 3, 2));
  EXPECT_NE(lost(gaps, 3), lost(gaps, 3, 1, other));
}

std::string refusal(const GapsConfig& gaps) {
  return test::message_of<ConfigError>([&] { gaps.validate(sample_s); });
}

TEST(Gaps, AreRefusedIfARateIsNegativeOrLittleIsLeft) {
  GapsConfig gaps;
  EXPECT_EQ(refusal(gaps), "");
  gaps.glitch_rate_hz = 0.02;
  gaps.orbital.depth = gaps.test.depth = 0.5;
  EXPECT_EQ(refusal(gaps), "");
  gaps.glitch_rate_hz = 0.1;
  EXPECT_EQ(refusal(gaps),
            "gaps.glitch_rate_hz = 0.1 (must leave more than a seventh of the windows of 8 s: 2.3 "
            "losses touch one, and may be 2)");
  gaps.telemetry_rate_hz = 0.2;
  gaps.telemetry_duration_s = 17.0;
  EXPECT_EQ(
      refusal(gaps),
      "gaps.telemetry_rate_hz = 0.2 (must leave more than a seventh of the windows of 8 s: 7.3 "
      "losses touch one, and may be 2)");
  gaps.spin.depth = 0.25;
  EXPECT_EQ(
      refusal(gaps),
      "gaps.orbital_modulation = 0.5 (must be at most 1 with the other modulations, not 1.25, "
      "as no rate is below 0)");
  gaps.test.depth = 0.7;
  EXPECT_EQ(
      refusal(gaps),
      "gaps.test_modulation = 0.7 (must be at most 1 with the other modulations, not 1.45, as "
      "no rate is below 0)");
}

}  // namespace
}  // namespace proofmass
