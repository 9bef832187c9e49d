#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/microscope/session/test_signals.hpp"

namespace proofmass {

// A session as data: what is excited, which lines are fitted, what the ground records
// and what the session is there to find. README.md explains the terms.

/// Settings that are the same for all sessions of a run: `[simulation]` of a campaign file.
struct SimulationConfig {
  double sample_period_s = 0.25;  ///< Of instrument, control loops and record.
  double settling_s = 4000.0;     ///< Time that the loops run before a session's record begins.

  static constexpr double settling_max_s = 50000.0;
};

// Excitations.

/// X is the sensitive axis, X and Z span the orbital plane, Y is normal to it. Of the satellite
/// frame S; for a moving test mass, of its sensor's frame K.
enum class Axis : std::uint8_t { x = 1, y = 2, z = 3 };

/// 0, 1 or 2.
[[nodiscard]] constexpr std::size_t index(Axis axis) { return static_cast<std::size_t>(axis) - 1; }

/// What a session shakes ([Hardy2013] section 4.2).
enum class ExcitationKind : std::uint8_t {
  attitude = 1,   ///< Angle added to the star tracker's output, rad.
  drag_free = 2,  ///< Acceleration C_cal added to the drag-free loop's input, m/s².
  test_mass = 3,  ///< Motion of the test masses in their sensors, m.
};

/// Which test masses move, and how: s_k of q_k(t) = [θ_k]ᵀ e_a s_k Δ_TM sin(2π f t), with e_a the
/// sensor's axis, Δ_TM the amplitude and f the frequency of the excitation.
enum class MassMotion : std::uint8_t {
  opposition = 1,  ///< s = (−½, +½): the relative motion has the full amplitude.
  mass_1 = 2,      ///< s = (1, 0), the inner mass.
  mass_2 = 3,      ///< s = (0, 1), the outer mass.
};

/// The measurement that the drag-free loop nulls: the half sum of both sensors, or one of them.
enum class DragFreeSource : std::uint8_t { common = 1, sensor_1 = 2, sensor_2 = 3 };

/// Of each sensor's measurement in the loop's input.
[[nodiscard]] constexpr std::array<double, 2> drag_free_weights(DragFreeSource source) {
  switch (source) {
    case DragFreeSource::sensor_1:
      return {1.0, 0.0};
    case DragFreeSource::sensor_2:
      return {0.0, 1.0};
    case DragFreeSource::common:
      break;
  }
  return {0.5, 0.5};
}

/// A sine a·sin(2π f t), with t = 0 at the session's start.
struct Excitation {
  ExcitationKind kind = ExcitationKind::drag_free;
  Axis axis = Axis::x;
  double amplitude = 0.0;  ///< a, in rad, m/s² or m according to `kind`; > 0.
  double frequency_hz = 0.0;
  MassMotion motion = MassMotion::opposition;  ///< For `test_mass` only.

  bool operator==(const Excitation&) const = default;
};

/// Excitations of one session at most, and those among them that move test masses.
inline constexpr std::size_t num_excitations_max = 4;
inline constexpr std::size_t num_mass_motions_max = 2;

// Signals of the ground.

/// What the ground uses of a session's record, computed sample by sample by ground_signals().
/// Gradients are elements of [T̂] − [În] in S, from the estimated attitude, s⁻².
enum class Signal : std::size_t {
  differential_x,  ///< Γ_mes,dx, half difference (sensor 1 − sensor 2), m/s².
  common_x,        ///< Γ_mes,c, half sum, m/s².
  common_y,
  common_z,
  gradient_xx,
  gradient_xy,
  gradient_xz,
  product,      ///< The one that the session's target needs, see Product.
  gradient_yx,  ///< From here on only where SignalSet::all is recorded: 0 elsewhere.
  gradient_yy,
  gradient_yz,
  gradient_zx,
  gradient_zy,
  gradient_zz,
};

inline constexpr std::size_t num_signals = 14;
inline constexpr std::size_t num_common_signals = 8;  ///< Those of SignalSet::common.

[[nodiscard]] constexpr std::size_t index(Signal signal) {
  return static_cast<std::size_t>(signal);
}

/// The signals that are recorded in a session.
enum class SignalSet : std::uint8_t {
  common,  ///< The first num_common_signals.
  all,
  health,  ///< Γ_mes,dx and the product: what the health of the loops is judged by.
};

/// What Signal::product is: a nonlinear combination that cannot be made from phasors afterwards.
enum class Product : std::uint8_t {
  none,              ///< 0.
  common_squared,    ///< Γ_mes,cx², m²/s⁴.
  sensor_1_squared,  ///< Γ_mes,1x², m²/s⁴.
  sensor_2_squared,  ///< Γ_mes,2x², m²/s⁴.
  modulated_yy,      ///< ½([T̂ − În]_yy − [T̂ − În]_xx) Δ_TM sin(2π f_TM t), m/s².
  modulated_zz,      ///< ½([T̂ − În]_zz − [T̂ − În]_xx) Δ_TM sin(2π f_TM t), m/s².
};

/// The signals of a line that an estimation method asks for beside the session's own: those before
/// Signal::product, and then some of its choice.
enum class LineSignals : std::uint8_t {
  gradients,  ///< The second and the third row of [T̂] − [În], s⁻².
  squares,    ///< Γ_mes,1x² and Γ_mes,2x², m²/s⁴.
  /// The elements of [T̂] − [În], row by row, times half the position of the moving masses, m/s².
  moved,
  moved_again,  ///< The same with the second of mass_excitations().
};

inline constexpr std::size_t num_line_bases = 7;                     ///< Before Signal::product.
inline constexpr std::size_t num_line_signals = num_line_bases + 9;  ///< At most.

/// Amplitudes of a line in the order of LineSignals, cosine's and sine's as in SessionPhasors.
using LinePhasors = std::array<std::complex<double>, num_line_signals>;

inline constexpr std::size_t num_fit_lines_max = 2;       ///< Of a session.
inline constexpr std::size_t num_session_lines_max = 16;  ///< The known lines with them.

/// What is left of a session's record: amplitudes of each signal at its lines, from one
/// least-squares fit of all lines behind the session's band-pass ([Hardy2013] section 5.2).
struct SessionPhasors {
  std::size_t num_fit_lines = 0;
  /// Of the lines of Session::fit_lines: shape [signal][line], in the signal's unit; the real part
  /// is the cosine's amplitude, the imaginary part the sine's.
  std::array<std::array<std::complex<double>, num_fit_lines_max>, num_signals> amplitude{};
  std::vector<LinePhasors> lines{};  ///< Of RecordNeeds::lines.
  /// Means over the record of the signals that every line has, if RecordNeeds::lines has any.
  std::array<double, num_line_bases> means{};
  /// Of a session that tests the equivalence principle; empty for others.
  std::vector<double> test_products{};
  SquareSteps<double> square_steps{};  ///< Likewise; 0 for others.
  /// XᵀRX of a test, with X its weighted regressors and R the covariance of the windows' noise, of
  /// scale 1.
  RegressorProducts test_noise{};
};

// Targets.

/// The quantity that a session's lines determine. The two K2 slopes yield K2c together. The values
/// are stored and sent: never renumber.
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
  no_target = 12,    ///< None: for estimation methods that do not go by targets.
  ep_test = 13,      ///< The Eötvös parameter; no calibration, see is_test().
};

inline constexpr std::size_t num_session_targets = 13;

/// 0 to 12.
[[nodiscard]] constexpr std::size_t index(SessionTarget target) {
  return static_cast<std::size_t>(target) - 1;
}

/// What a session may shake.
enum class ExcitationRule : std::uint8_t {
  none,      ///< Nothing.
  stimulus,  ///< The target's stimulus first, then anything.
  any,
};

/// What must be shaken for a target to show; amplitude and frequency are the session's choice.
struct Stimulus {
  ExcitationKind kind = ExcitationKind::drag_free;
  Axis axis = Axis::x;
  MassMotion motion = MassMotion::opposition;
};

/// All that is particular to a target: its calibration equation of [Hardy2013] section 4.2 as data.
/// The equation is: target = scale × slope of Γ_mes,dx against the regressor.
struct TargetInfo {
  SessionTarget target;
  std::string_view name;  ///< For files: `a_c11_delta_x`.
  ExcitationRule excitations;
  Stimulus stimulus;                        ///< Of ExcitationRule::stimulus.
  std::optional<DragFreeSource> drag_free;  ///< What the drag-free loop has to null; none: any.
  Signal regressor;   ///< What Γ_mes,dx is fitted against, unless no_target or ep_test.
  Product product;    ///< What Signal::product is in the session.
  double scale;       ///< The target is this times the slope of that fit.
  SignalSet signals;  ///< What the correction of Γ_mes,dx needs.
};

/// @pre target is one of the enumerators.
[[nodiscard]] const TargetInfo& target_info(SessionTarget target);

// Sessions.

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

/// A sequence of a whole number of orbits that calibrates, or tests; it starts at perigee.
struct Session {
  std::string name;  ///< Letters, digits, `_`; unique. Part of the name of its random streams.
  SessionTarget target = SessionTarget::a_c11_delta_x;
  int num_orbits = 10;
  /// Rate about Y at which the frame R turns against I: the frame that the attitude loop holds. 0
  /// is inertial pointing.
  double spin_rate_rad_s = 0.0;
  DragFreeSource drag_free = DragFreeSource::common;
  /// At most num_excitations_max. The first is the target's. Two that move test masses do so in
  /// opposition, along Y and along Z.
  std::vector<Excitation> excitations;
  /// Lines whose phasors give the estimate: one or two, or none in a test.
  std::vector<LineMultiple> fit_lines;
  std::vector<LineMultiple> known_lines;  ///< Other lines, fitted together with those.

  bool operator==(const Session&) const = default;
};

/// True for a session that tests the equivalence principle and calibrates nothing.
[[nodiscard]] inline bool is_test(const Session& session) {
  return session.target == SessionTarget::ep_test;
}

/// What the drag-free loop nulls where a_d11' is found: in its sessions; without any, in the first
/// test. a_d11' holds what the constant accelerations there make of the quadratic factors.
[[nodiscard]] DragFreeSource drag_free_of_a_d11_prime(const std::vector<Session>& sessions);

/// Frequency of a line of the session, Hz, without its sign; f_orb = 1/orbit_period_s.
[[nodiscard]] double line_frequency_hz(const Session& session, const LineMultiple& line,
                                       double orbit_period_s);

/// f_EP in the session's attitude, Hz, ≥ 0: a violation of the equivalence principle follows the
/// direction of the Earth, which turns by f_orb in an inertial frame and faster by f_spin in one
/// that turns about +Y.
[[nodiscard]] double test_frequency_hz(const Session& session, double orbit_period_s);

/// The excitations that move test masses, in their order; null where there is none.
using MassExcitations = std::array<const Excitation*, num_mass_motions_max>;
[[nodiscard]] MassExcitations mass_excitations(const Session& session);

/// The first one of these; null if there is none.
[[nodiscard]] inline const Excitation* mass_excitation(const Session& session) {
  return mass_excitations(session)[0];
}

/// The eleven sessions of the paper's 140 orbits ([Hardy2013] section 4.2).
[[nodiscard]] std::vector<Session> hardy2013_sessions();

/// Checks every session by itself, and that their names differ. Which targets the sessions have to
/// serve is a matter of the estimation, see EstimationMethodInfo::check.
/// @throws ConfigError naming `session[i].field`, i from 0.
void validate_sessions(const std::vector<Session>& sessions, double orbit_period_s,
                       double sample_period_s);

// Names in campaign files and messages.

/// Spelling of the enumerators, in value order from 1.
[[nodiscard]] std::span<const std::string_view> names_of(Axis);
[[nodiscard]] std::span<const std::string_view> names_of(ExcitationKind);
[[nodiscard]] std::span<const std::string_view> names_of(MassMotion);
[[nodiscard]] std::span<const std::string_view> names_of(DragFreeSource);
[[nodiscard]] std::span<const std::string_view> names_of(SessionTarget);

/// `a_c11_delta_x`, ending in a null byte.
/// @pre target is one of the enumerators.
[[nodiscard]] const char* name_of(SessionTarget target);

/// Name of the key that holds an excitation's amplitude, with its unit: `amplitude_rad`.
[[nodiscard]] std::string_view amplitude_key(ExcitationKind kind);

/// `[2, 1]`: the line at 2 f_orb + f; `[1, 0, 1]`: that at f_orb + f_spin.
[[nodiscard]] std::string text_of(const LineMultiple& line);

}  // namespace proofmass
