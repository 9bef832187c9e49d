#include "core/microscope/definition/made_environment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>
#include <vector>

#include "core/definition/document.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"

namespace proofmass {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double lowest_perigee_m = 200e3;  // Below, no satellite stays, and the air is another.

struct SettingsReader {
  Document& document;

  void operator()(std::string_view path, double& value, const Range& range) const {
    document.read(std::string(path), value, range);
  }
  void operator()(const std::string& path, Vector3<double>& value, const Range& range) const {
    document.read(path + ".x", value.x, range);
    document.read(path + ".y", value.y, range);
    document.read(path + ".z", value.z, range);
  }
};

/// Names of all sessions, for messages.
std::string all_names(const std::vector<Session>& sessions) {
  std::string names;
  for (const Session& session : sessions) {
    names += fmt::format("{}{}", names.empty() ? "" : " ", session.name);
  }
  return names;
}

/// The sessions that the file is for.
/// @throws ConfigError if there are none, or with several attitudes.
std::vector<Session> chosen_sessions(const std::vector<Session>& sessions,
                                     const std::string& name) {
  std::vector<Session> chosen;
  std::ranges::copy_if(sessions, std::back_inserter(chosen), [&](const Session& session) {
    return name.empty() || session.name == name;
  });
  if (chosen.empty()) {
    throw ConfigError("session", name, fmt::format("must be one of {}", all_names(sessions)));
  }
  const double rate = chosen.front().spin_rate_rad_s;
  const auto other = std::ranges::find_if(chosen, [&](const Session& session) {
    return session.spin_rate_rad_s < rate || session.spin_rate_rad_s > rate;
  });
  if (other == chosen.end()) return chosen;
  throw DefinitionError(fmt::format(
      "session = (must be given by --session: {} and {} differ in their spin, and a file has one)",
      chosen.front().name, other->name));
}

EnvironmentSpan span_of(const Scenario& scenario, const std::string& name) {
  const std::vector<Session> sessions = chosen_sessions(scenario.sessions, name);
  const Session& longest = *std::ranges::max_element(sessions, {}, &Session::num_orbits);
  const EnvironmentSpan span{.spin_rate_rad_s = longest.spin_rate_rad_s,
                             .settling_s = scenario.simulation.settling_s,
                             .num_orbits = longest.num_orbits};
  const double num_rows = num_rows_of(span, scenario.orbit);
  if (num_rows <= environment_rows_max) return span;
  throw ConfigError("session", longest.name,
                    fmt::format("its spin needs {:.0f} rows in {} orbits; a file has at most {}",
                                num_rows, longest.num_orbits, environment_rows_max));
}

void check_perigee(const OrbitConfig& orbit) {
  const double altitude_m = perigee_altitude_m(orbit);
  if (altitude_m >= lowest_perigee_m) return;
  const std::string rule = fmt::format("perigee must be at least {:.0f} km high, not {:.0f} km",
                                       1e-3 * lowest_perigee_m, 1e-3 * altitude_m);
  OrbitConfig circular = orbit;
  circular.eccentricity = 0.0;
  if (perigee_altitude_m(circular) < lowest_perigee_m) {
    throw ConfigError("orbit.period_s", fmt::format("{}", orbit.period_s), rule);
  }
  throw ConfigError("orbit.eccentricity", fmt::format("{}", orbit.eccentricity), rule);
}

/// Where drag is largest the density is to be good (air_density()).
std::string air_note(const Atmosphere& air, const OrbitConfig& orbit) {
  const double altitude_m = perigee_altitude_m(orbit);
  if (std::abs(altitude_m - air.reference_altitude_m) <= air.scale_height_m) return {};
  return fmt::format(
      "the perigee is {:.0f} km high, more than atmosphere.scale_height_m = {:.0f} km from "
      "atmosphere.reference_altitude_m = {:.0f} km: densities there may be wrong by factors",
      1e-3 * altitude_m, 1e-3 * air.scale_height_m, 1e-3 * air.reference_altitude_m);
}

/// Of every body: y² + z² of its mass, for one, is not above x² + y² and x² + z² together.
void check_inertia(const Vector3<double>& moments) {
  const double largest = std::max({moments.x, moments.y, moments.z});
  if (2.0 * largest <= moments.x + moments.y + moments.z) return;
  throw ConfigError("satellite.inertia_kg_m2", fmt::format("{}", largest),
                    "no principal moment may be above the sum of the others");
}

}  // namespace

std::string csv_text(const EnvironmentTable& table) {
  std::string text = fmt::format("{}\n", fmt::join(environment_table_schema().columns, ","));
  for (const auto& [time_s, linear, angular] : table) {
    text += fmt::format("{},{},{}\n", time_s, fmt::join(linear, ","), fmt::join(angular, ","));
  }
  return text;
}

EnvironmentPhysics read_physics(Document& settings) {
  EnvironmentPhysics physics;
  const SettingsReader read{settings};
  SatelliteBox& box = physics.satellite;
  read("satellite.mass_kg", box.mass_kg, range::between(1.0, 1e5));
  read("satellite.size_m", box.size_m, range::between(0.01, 100.0));
  read("satellite.pressure_centre_m", box.pressure_centre_m, range::between(-10.0, 10.0));
  read("satellite.inertia_kg_m2", box.inertia_kg_m2, range::between(0.01, 1e7));
  read("satellite.drag_coefficient", box.drag_coefficient, range::between(0.0, 10.0));
  read("satellite.reflectivity", box.reflectivity, range::between(0.0, 1.0));
  read("orbit.inclination_rad", physics.plane.inclination_rad, range::between(0.0, pi));
  read("orbit.perigee_argument_rad", physics.plane.perigee_argument_rad,
       range::between(-2 * pi, 2 * pi));
  Atmosphere& air = physics.atmosphere;
  read("atmosphere.reference_altitude_m", air.reference_altitude_m, range::between(200e3, 2000e3));
  read("atmosphere.night_density_kg_m3", air.night_density_kg_m3, range::between(0.0, 1e-6));
  read("atmosphere.scale_height_m", air.scale_height_m, range::between(10e3, 1000e3));
  read("atmosphere.bulge_ratio", air.bulge_ratio, range::between(1.0, 1000.0));
  read("atmosphere.bulge_lag_rad", air.bulge_lag_rad, range::between(-pi, pi));
  read("sun.beta_rad", physics.sun.beta_rad, range::between(-pi / 2, pi / 2));
  read("sun.phase_rad", physics.sun.phase_rad, range::between(-2 * pi, 2 * pi));
  read("sun.pressure_pa", physics.sun.pressure_pa, range::between(0.0, 1.0));
  read("earth.albedo", physics.albedo, range::between(0.0, 1.0));
  return physics;
}

MadeEnvironment made_environment(Document& campaign, Document& settings,
                                 const std::string& session) {
  const Scenario scenario = read_definition(campaign).scenario;
  campaign.check();
  const EnvironmentPhysics physics = read_physics(settings);
  settings.check();
  try {
    check_inertia(physics.satellite.inertia_kg_m2);
  } catch (const ConfigError& error) {
    throw settings.located(error);
  }
  try {
    validate_sessions(scenario.sessions, scenario.orbit.period_s,
                      scenario.simulation.sample_period_s);
    check_perigee(scenario.orbit);
  } catch (const ConfigError& error) {
    throw campaign.located(error);
  }
  const EnvironmentSpan span = span_of(scenario, session);
  return {table_of(PhysicalEnvironment(physics, scenario.orbit), span, scenario.orbit),
          air_note(physics.atmosphere, scenario.orbit)};
}

}  // namespace proofmass
