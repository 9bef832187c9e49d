#include "core/microscope/session/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
namespace {

using enum SessionTarget;
using enum ExcitationKind;
using enum MassMotion;

constexpr auto no_product = Product::none;
constexpr std::optional<DragFreeSource> any_drag_free;

constexpr auto quiet = ExcitationRule::none;
constexpr auto shaken = ExcitationRule::stimulus;

constexpr Stimulus no_stimulus{};
constexpr Stimulus turned_about_z{attitude, Axis::z};
constexpr Stimulus moved_along(Axis axis) { return {test_mass, axis}; }
constexpr Stimulus pushed_along(Axis axis) { return {drag_free, axis}; }

// The calibration equations of [Hardy2013] section 4.2, a row for each target. In the order of the
// rows, Γ_mes,dx is at the session's lines
//
//     ½ [T − In]_xj a_c11 Δ_j                              j = x, z, y
//     a_c1j ½([T − In]_jj − [T − In]_xx) Δ_TM sin(2π f_TM t)   j = 2, 3 (y, z)
//     a_d1j Γ_mes,cj                                       j = 1, 2, 3 (x, y, z)
//     K2d/K1c² Γ_mes,cx²
//     ±½ K2k/K1k² Γ_mes,kx²                                of the mass k that moves
//
// a_c1j multiplies the element jj less the element xx because the masses move along axes of their
// sensors, which are turned against the satellite's by θ, the larger part of a_c1j.
constexpr std::array<TargetInfo, num_session_targets> targets{{
    {a_c11_delta_x, "a_c11_delta_x", quiet, no_stimulus, any_drag_free, Signal::gradient_xx,
     no_product, 2.0, SignalSet::all},
    {a_c11_delta_z, "a_c11_delta_z", quiet, no_stimulus, any_drag_free, Signal::gradient_xz,
     no_product, 2.0, SignalSet::all},
    {a_c11_delta_y, "a_c11_delta_y", shaken, turned_about_z, any_drag_free, Signal::gradient_xy,
     no_product, 2.0, SignalSet::all},
    {a_c12, "a_c12", shaken, moved_along(Axis::y), any_drag_free, Signal::product,
     Product::modulated_yy, 1.0, SignalSet::common},
    {a_c13, "a_c13", shaken, moved_along(Axis::z), any_drag_free, Signal::product,
     Product::modulated_zz, 1.0, SignalSet::common},
    {a_d11_prime, "a_d11_prime", shaken, pushed_along(Axis::x), any_drag_free, Signal::common_x,
     no_product, 1.0, SignalSet::common},
    {a_d12, "a_d12", shaken, pushed_along(Axis::y), any_drag_free, Signal::common_y, no_product,
     1.0, SignalSet::common},
    {a_d13, "a_d13", shaken, pushed_along(Axis::z), any_drag_free, Signal::common_z, no_product,
     1.0, SignalSet::common},
    {k2d, "k2d", shaken, pushed_along(Axis::x), any_drag_free, Signal::product,
     Product::common_squared, 1.0, SignalSet::common},
    {k2_sensor_1, "k2_sensor_1", shaken, Stimulus{test_mass, Axis::x, mass_1},
     DragFreeSource::sensor_2, Signal::product, Product::sensor_1_squared, 2.0, SignalSet::common},
    {k2_sensor_2, "k2_sensor_2", shaken, Stimulus{test_mass, Axis::x, mass_2},
     DragFreeSource::sensor_1, Signal::product, Product::sensor_2_squared, -2.0, SignalSet::common},
    {no_target, "no_target", ExcitationRule::any, no_stimulus, any_drag_free, Signal::product,
     no_product, 0.0, SignalSet::common},
    {ep_test, "ep_test", quiet, no_stimulus, any_drag_free, Signal::product, no_product, 0.0,
     SignalSet::health},
}};

constexpr bool are_in_order() {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (index(targets[i].target) != i) return false;
  }
  return true;
}
static_assert(are_in_order());

constexpr std::array<std::string_view, num_session_targets> target_names = [] {
  std::array<std::string_view, num_session_targets> names{};
  for (std::size_t i = 0; i < targets.size(); ++i) names[i] = targets[i].name;
  return names;
}();

}  // namespace

const TargetInfo& target_info(SessionTarget target) {
  PROOFMASS_EXPECT(index(target) < targets.size());
  return targets[index(target)];
}

std::span<const std::string_view> names_of(SessionTarget) { return target_names; }

const char* name_of(SessionTarget target) { return target_info(target).name.data(); }

std::span<const std::string_view> names_of(Axis) {
  static constexpr std::array<std::string_view, 3> names{"x", "y", "z"};
  return names;
}

std::span<const std::string_view> names_of(ExcitationKind) {
  static constexpr std::array<std::string_view, 3> names{"attitude", "drag_free", "test_mass"};
  return names;
}

std::span<const std::string_view> names_of(MassMotion) {
  static constexpr std::array<std::string_view, 3> names{"opposition", "mass_1", "mass_2"};
  return names;
}

std::span<const std::string_view> names_of(DragFreeSource) {
  static constexpr std::array<std::string_view, 3> names{"common", "sensor_1", "sensor_2"};
  return names;
}

std::string_view amplitude_key(ExcitationKind kind) {
  static constexpr std::array<std::string_view, 3> keys{"amplitude_rad", "amplitude_m_s2",
                                                        "amplitude_m"};
  const auto position = static_cast<std::size_t>(kind) - 1;
  PROOFMASS_EXPECT(position < keys.size());
  return keys[position];
}

std::string text_of(const LineMultiple& line) {
  std::size_t num_further = line.further.size();
  while (num_further > 0 && line.further[num_further - 1] == 0.0) --num_further;
  std::string excitations = fmt::format("{}", line.excitation);
  if (num_further > 0) {
    for (std::size_t i = 0; i < num_further; ++i) {
      excitations += fmt::format(", {}", line.further[i]);
    }
    excitations = "[" + excitations + "]";
  }
  if (line.spin == 0.0) return fmt::format("[{}, {}]", line.orbital, excitations);
  return fmt::format("[{}, {}, {}]", line.orbital, excitations, line.spin);
}

DragFreeSource drag_free_of_a_d11_prime(const std::vector<Session>& sessions) {
  for (const SessionTarget target : {a_d11_prime, ep_test}) {
    const auto found = std::ranges::find(sessions, target, &Session::target);
    if (found != sessions.end()) return found->drag_free;
  }
  return DragFreeSource::common;
}

double line_frequency_hz(const Session& session, const LineMultiple& line, double orbit_period_s) {
  PROOFMASS_EXPECT(line.excitation == 0.0 || !session.excitations.empty());
  const double excitation_hz =
      line.excitation == 0.0 ? 0.0 : session.excitations.front().frequency_hz;
  const double spin_hz = session.spin_rate_rad_s / (2.0 * std::numbers::pi);
  double frequency_hz =
      line.orbital / orbit_period_s + line.excitation * excitation_hz + line.spin * spin_hz;
  for (std::size_t i = 0; i < line.further.size(); ++i) {
    if (line.further[i] == 0.0) continue;
    PROOFMASS_EXPECT(i + 1 < session.excitations.size());
    frequency_hz += line.further[i] * session.excitations[i + 1].frequency_hz;
  }
  return std::abs(frequency_hz);
}

MassExcitations mass_excitations(const Session& session) {
  MassExcitations found{};
  std::size_t num_found = 0;
  for (const Excitation& excitation : session.excitations) {
    if (excitation.kind != test_mass || num_found == found.size()) continue;
    found[num_found++] = &excitation;
  }
  return found;
}

double test_frequency_hz(const Session& session, double orbit_period_s) {
  return std::abs(1.0 / orbit_period_s + session.spin_rate_rad_s / (2.0 * std::numbers::pi));
}

namespace {

using LineList = std::vector<LineMultiple>;

// Calibration signals of model and mission: [Hardy2013] section 4.2 gives their kinds, the
// frequencies are those flown, the amplitudes reach the paper's accuracies.
constexpr Excitation swing_about_z{attitude, Axis::z, 3.5e-3, 1.0e-3, opposition};

constexpr Excitation push_along(Axis axis) {
  return {drag_free, axis, 2e-8, 1.22847554e-3, opposition};
}

constexpr Excitation move_along(Axis axis, MassMotion motion) {
  return {test_mass, axis, 10e-6, 9.88e-3, motion};
}

Session session_of(SessionTarget target, LineList fit_lines, LineList known_lines) {
  Session session;
  session.name = name_of(target);
  session.target = target;
  session.fit_lines = std::move(fit_lines);
  session.known_lines = std::move(known_lines);
  return session;
}

Session excited(Session session, const Excitation& excitation) {
  session.excitations = {excitation};
  return session;
}

Session locked_on(Session session, DragFreeSource source) {
  session.drag_free = source;
  return session;
}

Session lasting(Session session, int num_orbits) {
  session.num_orbits = num_orbits;
  return session;
}

}  // namespace

std::vector<Session> hardy2013_sessions() {
  const LineList gradient{{2, 0}};
  const LineList orbital{{1, 0}, {3, 0}, {4, 0}};
  const LineList sidebands{{2, 1}, {-2, 1}};
  const LineList all_sidebands{{1, 0}, {2, 0}, {2, 1}, {-2, 1}, {1, 1}, {-1, 1}};
  // At eccentricity e the gradient has a line 7e/2 as strong as that at 2 f_orb, at 3 f_orb;
  // unfitted, its sideband leaks 3e-5 rad into a_c13.
  const LineList carrier{{0, 1}, {1, 0}, {2, 0}, {1, 1}, {-1, 1}, {3, 1}, {-3, 1}};
  const LineList with_harmonic{{1, 0}, {2, 0}, {0, 2}};
  const LineList with_carrier{{0, 1}, {1, 0}, {2, 0}};
  const LineList quadratic{{0, 1}, {1, 0}, {2, 0}, {2, 1}, {-2, 1}, {1, 1}, {-1, 1}};
  return {
      session_of(a_c11_delta_x, gradient, orbital),
      session_of(a_c11_delta_z, gradient, orbital),
      excited(session_of(a_c11_delta_y, {{0, 1}}, all_sidebands), swing_about_z),
      lasting(excited(session_of(a_c12, sidebands, carrier), move_along(Axis::y, opposition)), 40),
      excited(session_of(a_c13, sidebands, carrier), move_along(Axis::z, opposition)),
      excited(session_of(a_d11_prime, {{0, 1}}, with_harmonic), push_along(Axis::x)),
      excited(session_of(a_d12, {{0, 1}}, with_harmonic), push_along(Axis::y)),
      excited(session_of(a_d13, {{0, 1}}, with_harmonic), push_along(Axis::z)),
      excited(session_of(k2d, {{0, 2}}, with_carrier), push_along(Axis::x)),
      locked_on(excited(session_of(k2_sensor_1, {{0, 2}}, quadratic), move_along(Axis::x, mass_1)),
                DragFreeSource::sensor_2),
      locked_on(excited(session_of(k2_sensor_2, {{0, 2}}, quadratic), move_along(Axis::x, mass_2)),
                DragFreeSource::sensor_1),
  };
}

}  // namespace proofmass
