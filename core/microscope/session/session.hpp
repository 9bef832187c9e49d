#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/microscope/session/excitation.hpp"
#include "core/microscope/session/target.hpp"

namespace proofmass {

/// What is the same for all sessions of a run.
struct SimulationConfig {
  double sample_period_s = 0.25;
  double settling_s = 4000.0;  ///< Time that the loops run before a session's record begins.
};

/// The frequency orbital·f_orb + excitation·f + spin·f_spin, with f that of the session's first
/// excitation and f_spin = spin_rate_rad_s/2π, plus multiples of its further excitations. Multiples
/// need not be whole: 5.5 f_orb is a line of a session that spins at 4.5 f_orb.
struct LineMultiple {
  double orbital = 0.0;
  double excitation = 0.0;
  double spin = 0.0;
  std::array<double, num_excitations_max - 1> further{};  ///< Of the second excitation and on.

  bool operator==(const LineMultiple&) const = default;
};

/// One calibration sequence of a whole number of orbits; it starts at perigee.
struct Session {
  std::string name;  ///< Letters, digits, `_`; unique. Part of the name of its random streams.
  SessionTarget target = SessionTarget::a_c11_delta_x;
  int num_orbits = 10;
  double spin_rate_rad_s = 0.0;  ///< Rate about Y of the frame that the attitude loop holds.
  DragFreeSource drag_free = DragFreeSource::common;
  /// At most num_excitations_max, of which one moves test masses. The first is the target's.
  std::vector<Excitation> excitations;
  std::vector<LineMultiple> fit_lines;    ///< Lines whose phasors give the estimate: one or two.
  std::vector<LineMultiple> known_lines;  ///< Other lines, fitted together with those.

  bool operator==(const Session&) const = default;
};

/// Frequency of a line of the session, Hz; f_orb = 1/orbit_period_s.
[[nodiscard]] double line_frequency_hz(const Session& session, const LineMultiple& line,
                                       double orbit_period_s);

/// f_EP in the session's attitude, Hz: a violation of the equivalence principle follows the
/// direction of the Earth, which turns by f_orb in an inertial frame and faster by f_spin in one
/// that turns about +Y.
[[nodiscard]] double test_frequency_hz(const Session& session, double orbit_period_s);

/// The eleven sessions of the paper's 140 orbits ([Hardy2013] section 4.2).
[[nodiscard]] std::vector<Session> hardy2013_sessions();

/// The excitation that moves test masses, or nothing.
[[nodiscard]] const Excitation* mass_excitation(const Session& session);

/// Checks every session by itself, and that their names differ. Which targets the sessions have to
/// serve is a matter of the estimation, see EstimationMethodInfo::check.
/// @throws ConfigError naming `session[i].field`, i from 0.
void validate_sessions(const std::vector<Session>& sessions, double orbit_period_s,
                       double sample_period_s);

}  // namespace proofmass
