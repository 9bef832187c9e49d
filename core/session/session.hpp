#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace proofmass {

/// Axes of the satellite frame S (and, for a test mass, of its sensor frame). X is sensitive, X and
/// Z span the orbital plane, Y is normal to it.
enum class Axis : std::uint8_t { x = 1, y = 2, z = 3 };

/// 0, 1 or 2.
[[nodiscard]] constexpr std::size_t index(Axis axis) { return static_cast<std::size_t>(axis) - 1; }

/// What a session shakes.
enum class ExcitationKind : std::uint8_t {
  attitude = 1,   ///< Angle added to the star tracker's output, rad.
  drag_free = 2,  ///< Acceleration C_cal added to the drag-free loop's input, m/s².
  test_mass = 3,  ///< Motion of the test masses in their sensors, m.
};

/// Which test masses move, and how: s_k of q_k(t) = [θ_k]ᵀ e_a s_k Δ_TM sin(2π f t).
enum class MassMotion : std::uint8_t {
  opposition = 1,  ///< s = (−½, +½): the relative motion has the full amplitude.
  mass_1 = 2,      ///< s = (1, 0), the inner mass.
  mass_2 = 3,      ///< s = (0, 1), the outer mass.
};

/// The measurement that the drag-free loop nulls.
enum class DragFreeSource : std::uint8_t { common = 1, sensor_1 = 2, sensor_2 = 3 };

/// A sine a·sin(2π f t), with t = 0 at the session's start.
struct Excitation {
  ExcitationKind kind = ExcitationKind::drag_free;
  Axis axis = Axis::x;
  double amplitude = 0.0;  ///< rad, m/s² or m, according to `kind`; > 0.
  double frequency_hz = 0.0;
  MassMotion motion = MassMotion::opposition;  ///< For `test_mass` only.

  bool operator==(const Excitation&) const = default;
};

/// The frequency orbital·f_orb + excitation·f + spin·f_spin, with f that of the session's
/// excitation and f_spin = spin_rate_rad_s/2π. Multiples need not be whole: 5.5 f_orb is a line of
/// a session that spins at 4.5 f_orb.
struct LineMultiple {
  double orbital = 0.0;
  double excitation = 0.0;
  double spin = 0.0;

  bool operator==(const LineMultiple&) const = default;
};

/// The quantity that a session's lines determine. The two K2 slopes yield K2c together.
enum class SessionTarget : std::uint8_t {
  a_c11_delta_x = 1,
  a_c11_delta_z = 2,
  a_c11_delta_y = 3,
  a_c12 = 4,
  a_c13 = 5,
  a_d11_prime = 6,
  a_d12 = 7,
  a_d13 = 8,
  k2d = 9,
  k2_sensor_1 = 10,  ///< K21/K11², mass 1 moving, drag-free on mass 2.
  k2_sensor_2 = 11,  ///< K22/K12², mass 2 moving, drag-free on mass 1.
};

inline constexpr std::size_t num_session_targets = 11;

/// 0 to 10.
[[nodiscard]] constexpr std::size_t index(SessionTarget target) {
  return static_cast<std::size_t>(target) - 1;
}

/// One calibration sequence of a whole number of orbits; it starts at perigee.
struct Session {
  std::string name;  ///< Letters, digits, `_`; unique. Part of the name of its random streams.
  SessionTarget target = SessionTarget::a_c11_delta_x;
  int num_orbits = 10;
  double spin_rate_rad_s = 0.0;  ///< Rate about Y of the frame that the attitude loop holds.
  DragFreeSource drag_free = DragFreeSource::common;
  std::vector<Excitation> excitations;    ///< None or one.
  std::vector<LineMultiple> fit_lines;    ///< Lines whose phasors give the estimate.
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

/// Names for files: `a_c11_delta_x`.
[[nodiscard]] const char* name_of(SessionTarget target);

/// The eleven sessions of the paper's 140 orbits ([Hardy2013] section 4.2).
[[nodiscard]] std::vector<Session> hardy2013_sessions();

/// Checks every session by itself and all of them together.
/// @throws ConfigError naming `session[i].field`, i from 0.
void validate_sessions(const std::vector<Session>& sessions, double orbit_period_s,
                       double sample_period_s);

}  // namespace proofmass
