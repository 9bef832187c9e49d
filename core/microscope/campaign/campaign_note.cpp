#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "core/math/elementary.hpp"
#include "core/microscope/campaign/loop_margins.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/instrument/drawn_sizes.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

// What `proofmass check` says of a campaign that is valid: effects that its results will have and
// whose cause is a setting.

namespace proofmass {
namespace {

/// Health of the loops is measured where nothing is shaken.
std::string unwatched_note(const Scenario& scenario) {
  const auto is_quiet = [](const Session& session) {
    return !is_test(session) && session.excitations.empty();
  };
  if (scenario.noise.scale == 0.0 || std::ranges::any_of(scenario.sessions, is_quiet)) return {};
  return "no session watches the noise of the loops, which may move every estimate: add one "
         "with target = \"no_target\" and fit_lines = [[2, 0]]";
}

std::string loops_note(const Scenario& scenario) {
  if (scenario.has_plain_loops()) return {};
  const std::vector<AxisMargins> of_axes = loop_margins(scenario, make_instrument({}));
  const auto axis_text = [](const AxisMargins& of) {
    const std::string_view in = of.resonator_of.empty() ? "" : " in ";
    return fmt::format("{} {}{}{}", name_of(of.loop), name_of(of.axis), in, of.resonator_of);
  };
  const auto by_gain = [](const AxisMargins& of) { return of.margins.gain; };
  const auto by_phase = [](const AxisMargins& of) { return of.margins.phase_rad; };
  const AxisMargins gain = *std::ranges::min_element(of_axes, {}, by_gain);
  const AxisMargins phase = *std::ranges::min_element(of_axes, {}, by_phase);
  const std::string_view of_realism =
      scenario.realism ? "; errors have what [realism] adds, and standard errors do not" : "";
  const std::string_view cause = scenario.controllers.empty() ? "[realism]"
                                 : scenario.realism           ? "[[controller]] and [realism]"
                                                              : "[[controller]]";
  return fmt::format(
      "with {} and a perfect instrument, the least margin of gain is a factor of {:.3g} up or down "
      "({}), that of phase {:.3g}° ({}); each run has its own, gain_margin and phase_margin_rad{}",
      cause, gain.margins.gain, axis_text(gain), phase.margins.phase_rad * 180.0 / std::numbers::pi,
      axis_text(phase), of_realism);
}

/// Largest magnitude in an orbit of the external acceleration along each axis of S, m/s².
std::array<double, 3> largest_external(const MicroscopeCampaign& campaign, const Session& session) {
  constexpr int num_points = 360;
  const Scenario& scenario = campaign.scenario;
  const Environment environment(scenario.environment, campaign.environment_table,
                                scenario.orbit.period_s);
  const KeplerOrbit orbit(scenario.orbit);
  const bool turns =
      session.spin_rate_rad_s != 0.0 && scenario.environment.kind == EnvironmentKind::harmonic;
  std::array<double, 3> largest_m_s2{};
  for (int i = 0; i < num_points; ++i) {
    const double time_s = scenario.orbit.period_s * i / num_points;
    Vector3<double> external = environment.at(time_s, orbit.at(time_s)).linear_m_s2;
    // Where it turns about Y, each of X and Z meets all that lies in their plane.
    if (turns)
      external.x = external.z = std::sqrt(external.x * external.x + external.z * external.z);
    for (const Axis axis : {Axis::x, Axis::y, Axis::z}) {
      double& largest = largest_m_s2[index(axis)];
      largest = std::max(largest, std::abs(external[index(axis)]));
    }
  }
  return largest_m_s2;
}

/// What thrusters may be commanded at most along each axis of S in a session, m/s²: they give (1 +
/// ε) of it, and the loop moves the satellite so that what it measures, biases included, is the
/// push.
std::array<double, 3> largest_thrust(const MicroscopeCampaign& campaign, const Session& session,
                                     const DrawnSizes& sizes) {
  constexpr double least_gain = 0.01;
  std::array<double, 3> thrust_m_s2 = largest_external(campaign, session);
  for (const Excitation& excitation : session.excitations) {
    if (excitation.kind == ExcitationKind::drag_free) {
      thrust_m_s2[index(excitation.axis)] += excitation.amplitude;
    }
  }
  for (std::size_t axis = 0; axis < thrust_m_s2.size(); ++axis) {
    thrust_m_s2[axis] += sizes.of_pair("read_out_bias_m_s2", axis) +
                         sizes.of_pair("parasitic_acceleration_m_s2", axis);
    thrust_m_s2[axis] /= std::max(1.0 - sizes.of_axis("thruster_scale_error", axis), least_gain);
  }
  return thrust_m_s2;
}

/// What thrusters at their limit leave undone are lines that K2 squares. Of 200 runs of the nominal
/// campaign, which may need 6.5e-8 m/s², a limit of 4.4e-8 moves K2d by up to 1.75 of its
/// objective, one of 5.2e-8 by 3e-4, and one of 5.6e-8 none.
std::string thrust_note(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  const double limit_m_s2 = scenario.realism ? scenario.realism->thrust_limit_m_s2 : 0.0;
  if (limit_m_s2 == 0.0) return {};
  double largest_m_s2 = limit_m_s2;
  std::string_view name;
  const DrawnSizes sizes(campaign.dispersions, campaign.table_columns);
  for (const Session& session : scenario.sessions) {
    const double of_session_m_s2 = std::ranges::max(largest_thrust(campaign, session, sizes));
    if (of_session_m_s2 <= largest_m_s2) continue;
    largest_m_s2 = of_session_m_s2;
    name = session.name;
  }
  if (name.empty()) return {};
  return fmt::format(
      "realism.thrust_limit_m_s2 = {} is less than the {:.2g} m/s² that environment, push, biases "
      "and thrusters of a draw may need in session {}: what thrusters at their limit leave undone "
      "shifts the estimates",
      limit_m_s2, largest_m_s2, name);
}

/// The band-pass lets no drift through, but answers its beginning: 1e-17 m/s³ of a sensor move
/// a_c11·Δx by 0.01 of its objective after 1,000 s of 10 orbits, without noise.
std::string drift_note(const Scenario& scenario) {
  constexpr double least_m_s3 = 1e-17;
  constexpr double num_decays = 7.0;  // e⁻⁷ is a thousandth.
  if (!scenario.realism || estimation_method(scenario.estimation.method).has_standard_errors)
    return {};
  const auto is_small = [](double drift_m_s3) { return std::abs(drift_m_s3) < least_m_s3; };
  if (std::ranges::all_of(scenario.realism->bias_drift_m_s3, is_small)) return {};
  double longest_s = 0.0;
  for (const Session& session : scenario.sessions) {
    if (is_test(session) || session.fit_lines.empty()) continue;
    longest_s = std::max(longest_s, band_decay_s(scenario, session));
  }
  const double least_s = num_decays * longest_s;
  if (scenario.estimation.transient_s >= least_s) return {};
  return fmt::format(
      "biases drift, and with estimation.transient_s = {} s the filter's answer to the beginning "
      "of a record is in the estimates; after {:.0f} s a thousandth of it is left",
      scenario.estimation.transient_s, std::ceil(least_s));
}

/// Whether the gradient's harmonics from 4 f_orb on, where they are not fitted, shift a_c13 by more
/// than 1/50 of its objective, 1.8e-5. Measured without noise, in inertial pointing: by 0.3 e³/N
/// rad in N orbits, of which there are 3 or more, and by 1.5e-5 at the bounds for shorter sessions;
/// a_c12 is not shifted.
bool shifts_a_c13(double e, int num_orbits) {
  if (num_orbits == 1) return e > 0.012;
  if (num_orbits == 2) return e > 0.035;
  return 0.3 * e * e * e > 1.8e-5 * num_orbits;
}

/// Fitted at 4, 5 and 6 f_orb, the harmonics shift a_c13 by 1/50 of its objective and less at e =
/// 0.1 in two orbits or more (measured: by 0.020, 0.011, 0.006 and 0.003 in 2, 3, 5 and 10 orbits,
/// against 0.25, 0.12, 0.07 and 0.035). Those of 4 f_orb alone change nothing in ten orbits, and in
/// one orbit none of them helps.
std::string eccentricity_note(const Scenario& scenario) {
  const double e = scenario.orbit.eccentricity;
  const auto has = [](const std::vector<LineMultiple>& lines, double orbital) {
    return std::ranges::find(lines, LineMultiple{orbital, 1.0}) != lines.end();
  };
  std::vector<std::string_view> sessions;
  for (const Session& session : scenario.sessions) {
    if (session.target != SessionTarget::a_c13 || !shifts_a_c13(e, session.num_orbits)) continue;
    const bool is_complete =
        std::ranges::all_of(std::array{4.0, -4.0, 5.0, -5.0, 6.0, -6.0},
                            [&](double orbital) { return has(session.known_lines, orbital); });
    const bool is_short = session.num_orbits < 2;
    if (has(session.fit_lines, 2.0) && (is_short || !is_complete)) sessions.push_back(session.name);
  }
  if (sessions.empty()) return {};
  return fmt::format(
      "orbit.eccentricity = {}: harmonics of the gradient that are not fitted shift a_c13 by more "
      "than 1/50 of its objective in sessions of one orbit, or whose known_lines lack [k, 1] and "
      "[-k, 1] of k = 4, 5 and 6: {}",
      e, fmt::join(sessions, ", "));
}

/// What the loops' start leaves in a record looks like noise to fits and monitors.
std::string settling_note(const Scenario& scenario) {
  constexpr double num_decays = 7.0;  // e⁻⁷ is a thousandth.
  const double decay_s = slowest_decay_s(scenario), least_s = std::ceil(num_decays * decay_s);
  if (scenario.simulation.settling_s >= least_s) return {};
  const std::string_view effect =
      "records begin before the loops have settled, which standard errors may take for noise: "
      "their slowest mode";
  const std::string_view cause = scenario.controllers.empty()
                                     ? "raise the integral_hz of the loop, or set it to 0"
                                     : "a [[controller]] holds what it steers too weakly";
  if (decay_s > 1e6) return fmt::format("{} hardly decays: {}", effect, cause);
  const std::string advice =
      least_s > SimulationConfig::settling_max_s
          ? fmt::format("no simulation.settling_s is long enough: {}", cause)
          : fmt::format(
                "simulation.settling_s = {} is less than the {:.0f} s after which a "
                "thousandth of it is left",
                scenario.simulation.settling_s, least_s);
  return fmt::format("{} decays by e in {:.0f} s, and {}", effect, decay_s, advice);
}

/// What a resonator takes from a line comes in with time.
std::string resonator_note(const Scenario& scenario) {
  constexpr double part_max = 0.1;
  const double damping = scenario.drag_free.resonator_damping;
  double largest = part_max, decay_s = 0.0;
  for (const Session& session : scenario.sessions) {
    if (damping == 0.0 || !is_test(session)) continue;
    const double period_s = scenario.orbit.period_s, duration_s = session.num_orbits * period_s;
    const double of_session_s =
        1.0 / (2.0 * std::numbers::pi * damping * test_frequency_hz(session, period_s));
    const double part = exponential(-scenario.simulation.settling_s / of_session_s) *
                        (1.0 - exponential(-duration_s / of_session_s)) * of_session_s / duration_s;
    if (part > largest) std::tie(largest, decay_s) = std::pair(part, of_session_s);
  }
  if (largest == part_max) return {};
  return fmt::format(
      "with drag_free.resonator_damping = {} what the loop leaves at f_EP decays by e in {:.0f} s, "
      "so that {:.0f} % of it is left in the mean of a test: raise it, or simulation.settling_s",
      damping, decay_s, 100.0 * largest);
}

/// A straight line between rows weakens a line at ω by (ωh)²/12: a tenth of an orbit, at 2 f_orb,
/// by an eighth.
std::string rows_note(const MicroscopeCampaign& campaign) {
  const EnvironmentTable& table = campaign.environment_table;
  const double longest_s = 0.1 * campaign.scenario.orbit.period_s;
  for (std::size_t i = 1; i < table.size(); ++i) {
    const EnvironmentRow &row = table[i - 1], &next = table[i];
    const bool is_constant =
        row.linear_m_s2 == next.linear_m_s2 && row.angular_rad_s2 == next.angular_rad_s2;
    if (is_constant || next.time_s - row.time_s <= longest_s) continue;
    return fmt::format(
        "environment.file has no row for {:.0f} s after time_s = {:.0f}, more than a tenth of an "
        "orbit: accelerations there are those of a straight line",
        next.time_s - row.time_s, row.time_s);
  }
  return {};
}

/// A file has the accelerations in the satellite's frame, and so those of one spin.
std::string environment_note(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  if (campaign.environment_table.empty()) return {};
  const auto [slow, fast] = std::ranges::minmax(scenario.sessions, {},
                                                [](const Session& s) { return s.spin_rate_rad_s; });
  if (slow.spin_rate_rad_s != fast.spin_rate_rad_s) {
    return fmt::format(
        "environment.file has accelerations in the satellite's frame, and the satellite spins "
        "otherwise in {} than in {}: it is right for one of them at most",
        slow.name, fast.name);
  }
  const int num_orbits = std::ranges::max(scenario.sessions, {}, &Session::num_orbits).num_orbits;
  const double end_s = campaign.environment_table.back().time_s;
  const double turns = slow.spin_rate_rad_s * scenario.orbit.period_s / (2.0 * std::numbers::pi);
  if (end_s >= num_orbits * scenario.orbit.period_s) return {};
  if (std::abs(turns - std::round(turns)) < 1e-6) return {};
  return fmt::format(
      "environment.file ends after {:.0f} s, and then its first orbit is repeated, in which the "
      "satellite makes {:.6g} turns: not a whole number, so that accelerations jump; make the file "
      "as long as the longest session",
      end_s, turns);
}

std::string gaps_note(const Scenario& scenario) {
  const GapsConfig& gaps = scenario.gaps;
  if (!scenario.has_tests() || !gaps.lose_data()) return {};
  double num_orbits = 0.0, num_lost = 0.0;
  for (const Session& session : scenario.sessions) {
    if (!is_test(session)) continue;
    num_orbits += session.num_orbits;
    num_lost += session.num_orbits * (1.0 - kept_part(gaps, session, scenario.orbit.period_s));
  }
  return fmt::format("[gaps] takes about {:.2g} % of the samples of tests",
                     100.0 * num_lost / num_orbits);
}

}  // namespace

std::string MicroscopeCampaign::note() const {
  std::string all;
  for (const std::string& note :
       {unwatched_note(scenario), loops_note(scenario), thrust_note(*this), settling_note(scenario),
        resonator_note(scenario), drift_note(scenario), eccentricity_note(scenario),
        rows_note(*this), environment_note(*this), gaps_note(scenario)}) {
    if (!all.empty() && !note.empty()) all += "; ";
    all += note;
  }
  return all;
}

}  // namespace proofmass
