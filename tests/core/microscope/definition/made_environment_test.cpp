#include "core/microscope/definition/made_environment.hpp"

#include "core/campaign/definition.hpp"
#include "core/definition/document.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

// Every setting has a value of its own, so that none can stand in for another.
TEST(ReadPhysics, ReadsEverySetting) {
  Document settings("physics.toml", R"(
[satellite]
mass_kg = 2.0
size_m = { x = 3.0, y = 4.0, z = 5.0 }
pressure_centre_m = { x = 0.6, y = 0.7, z = 0.8 }
inertia_kg_m2 = { x = 9.0, y = 10.0, z = 11.0 }
drag_coefficient = 1.2
reflectivity = 0.13
[orbit]
inclination_rad = 1.4
perigee_argument_rad = 1.5
[atmosphere]
reference_altitude_m = 1600e3
night_density_kg_m3 = 1.7e-14
scale_height_m = 18e3
bulge_ratio = 1.9
bulge_lag_rad = 0.2
[sun]
beta_rad = 0.21
phase_rad = 0.22
pressure_pa = 0.23
[earth]
albedo = 0.24
)",
                    {});
  const EnvironmentPhysics physics = read_physics(settings);
  EXPECT_NO_THROW(settings.check());
  const std::array<double, 23> expected{2.0,  3.0,  4.0, 5.0,  0.6,  0.7,  0.8,  9.0,
                                        10.0, 11.0, 1.2, 0.13, 1.4,  1.5,  16e5, 1.7e-14,
                                        18e3, 1.9,  0.2, 0.21, 0.22, 0.23, 0.24};
  EXPECT_EQ((std::bit_cast<std::array<double, 23>>(physics)), expected);
}

TEST(CsvText, ReadsBackToTheSameBits) {
  const EnvironmentTable table{{-0.1, {1.0 / 3.0, -2e-9, 5e-324}, {1e300, 0.0, -1.0 / 7.0}},
                               {100.0, {1, 2, 3}, {4, 5, 6}}};
  EXPECT_EQ(parse_environment(csv_text(table), "made.csv", 100.0), table);
}

EnvironmentTable made_for(const std::string& campaign, const std::string& session) {
  Document document("a.toml", campaign, {});
  Document settings("", "", {});
  return made_environment(document, settings, session).table;
}

const std::string two_attitudes = R"(
[[session]]
name = "still"
target = "ep_test"
orbits = 20
[[session]]
name = "turning"
target = "ep_test"
orbits = 3
spin_rate_rad_s = 0.004
[[session]]
name = "longer"
target = "ep_test"
orbits = 5
spin_rate_rad_s = 0.004
)";

// The time that a session takes and, before it, the loops to settle; an orbit at rest.
TEST(MadeEnvironment, CoversTheSessionThatItIsFor) {
  constexpr double period_s = 5950.0, settling_s = 4000.0, step_s = period_s / 600.0;
  const EnvironmentTable still = made_for(two_attitudes, "still");
  EXPECT_EQ(still.front().time_s, 0.0);
  EXPECT_NEAR(still.back().time_s, period_s, 2.0 * step_s);
  const EnvironmentTable turning = made_for(two_attitudes, "turning");
  EXPECT_NEAR(turning.front().time_s, -settling_s, step_s);
  EXPECT_LE(turning.front().time_s, -settling_s);
  EXPECT_NEAR(turning.back().time_s, 3.0 * period_s, 2.0 * step_s);
}

// Without a name it is for all sessions, if they agree, and for the longest of these.
TEST(MadeEnvironment, IsForAllSessionsWithoutAName) {
  const std::size_t second = two_attitudes.find("[[session]]", 5);
  const EnvironmentTable both = made_for(two_attitudes.substr(second), "");
  EXPECT_EQ(both, made_for(two_attitudes, "longer"));
}

// The radius is ∛(μ (P/2π)²): an orbit of 5350 s is 233 km above the equator's, one of 5950 s 719
// km.
TEST(MadeEnvironment, NotesThatItsAirIsThatOfAnotherAltitude) {
  const auto note_for = [](const std::string& orbit, const std::string& physics) {
    Document document("a.toml", orbit, {});
    Document settings("physics.toml", physics, {});
    return made_environment(document, settings, "").note;
  };
  const std::string low = "[orbit]\nperiod_s = 5350.0\neccentricity = 0.0\n";
  EXPECT_EQ(note_for("", ""), "");
  EXPECT_EQ(note_for(low, ""),
            "the perigee is 233 km high, more than atmosphere.scale_height_m = 89 km from "
            "atmosphere.reference_altitude_m = 700 km: densities there may be wrong by factors");
  EXPECT_EQ(note_for(low, "[atmosphere]\nreference_altitude_m = 300e3\n"), "");
}

}  // namespace
}  // namespace proofmass
