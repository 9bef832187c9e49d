#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/estimation/joint/joint.hpp"

namespace proofmass {
namespace {

bool moves_apart(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::test_mass && excitation.axis != Axis::x &&
         excitation.motion == MassMotion::opposition;
}

bool pushes_along_x(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::drag_free && excitation.axis == Axis::x;
}

/// Whether the squares of Γ_mes,kx tell at 2 f of K2.
bool tells_of_squares(const Excitation& excitation) {
  return pushes_along_x(excitation) ||
         (excitation.axis == Axis::x && excitation.kind == ExcitationKind::test_mass &&
          excitation.motion != MassMotion::opposition);
}

/// Two that shake X make lines at sum and difference of their frequencies, of K2 times both: 1e-11
/// m/s², which tell no more than the squares do, and leak.
void add_products(const std::vector<Excitation>& excitations, RecordNeeds& needs) {
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    for (std::size_t j = i + 1; j < excitations.size(); ++j) {
      if (!tells_of_squares(excitations[i]) || !tells_of_squares(excitations[j])) continue;
      for (const double sign : {1.0, -1.0}) {
        LineMultiple product = excitation_multiple(i, 1.0);
        product.further[j - 1] = sign;
        needs.neighbours.push_back(product);
      }
    }
  }
}

}  // namespace

LineMultiple excitation_multiple(std::size_t excitation, double factor, double orbital) {
  LineMultiple line{.orbital = orbital};
  (excitation == 0 ? line.excitation : line.further[excitation - 1]) = factor;
  return line;
}

RecordNeeds joint_needs(const Session& session) {
  RecordNeeds needs{.signals = SignalSet::health};
  if (is_test(session)) return needs;
  const std::vector<Excitation>& excitations = session.excitations;
  needs.lines.push_back({{.orbital = 2.0}, LineSignals::gradients});
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind == ExcitationKind::test_mass) continue;
    needs.lines.push_back({excitation_multiple(i, 1.0), LineSignals::gradients});
  }
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!tells_of_squares(excitations[i])) continue;
    needs.lines.push_back({excitation_multiple(i, 2.0), LineSignals::squares});
  }
  const MassExcitations motions = mass_excitations(session);
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!moves_apart(excitations[i])) continue;
    const bool is_first = &excitations[i] == motions[0];
    for (const double orbital : {2.0, -2.0}) {
      needs.lines.push_back({excitation_multiple(i, 1.0, orbital),
                             is_first ? LineSignals::moved : LineSignals::moved_again});
    }
  }
  // Lines of which the model of another line has no term: they must not leak into it. A line that
  // the model describes may leak, because its signals leak alike.
  needs.neighbours = {{.orbital = 1.0}, {.orbital = 3.0}};
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind != ExcitationKind::test_mass) continue;
    for (const double orbital : {0.0, 2.0, -2.0}) {
      needs.neighbours.push_back(excitation_multiple(i, 1.0, orbital));
    }
    // The signals of one motion do not tell what leaks from the other one.
    if (motions[1] == nullptr) continue;
    for (const double orbital : {1.0, -1.0, 3.0, -3.0}) {
      needs.neighbours.push_back(excitation_multiple(i, 1.0, orbital));
    }
  }
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    // Along X ½ K2c K2d Γ³, as much as the noise of the line at Γ = 1e-7 m/s² already; along Y and
    // Z what the squares make there of Γ_mes,c, times a_d1j.
    if (excitations[i].kind != ExcitationKind::drag_free) continue;
    if (!pushes_along_x(excitations[i])) needs.neighbours.push_back(excitation_multiple(i, 2.0));
    needs.neighbours.push_back(excitation_multiple(i, 3.0));
  }
  add_products(excitations, needs);
  return needs;
}

namespace {

template <Axis axis>
bool pushes(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::drag_free && excitation.axis == axis;
}

template <Axis axis>
bool moves_apart_along(const Excitation& excitation) {
  return moves_apart(excitation) && excitation.axis == axis;
}

bool turns_about_z(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::attitude && excitation.axis == Axis::z;
}

bool moves_one_along_x(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::test_mass && tells_of_squares(excitation);
}

/// An excitation that some session must have, and the parameters for which it must.
struct Need {
  std::string_view what;
  bool (*is_it)(const Excitation&);
  std::array<Parameter, 2> parameters;  ///< Equal if it is one.
};

constexpr std::array needs{
    Need{"pushes along x", pushes<Axis::x>, {Parameter::a_d11_prime, Parameter::a_d11_prime}},
    Need{"pushes along y", pushes<Axis::y>, {Parameter::a_d12, Parameter::a_d12}},
    Need{"pushes along z", pushes<Axis::z>, {Parameter::a_d13, Parameter::a_d13}},
    Need{"turns about z", turns_about_z, {Parameter::a_c11_delta_y, Parameter::a_c11_delta_y}},
    Need{"moves masses in opposition along y",
         moves_apart_along<Axis::y>,
         {Parameter::a_c12, Parameter::a_c12}},
    Need{"moves masses in opposition along z",
         moves_apart_along<Axis::z>,
         {Parameter::a_c13, Parameter::a_c13}},
    Need{"moves one mass along x", moves_one_along_x, {Parameter::k2d, Parameter::k2c}}};

/// Null for a parameter that every session determines if it is long enough.
const Need* need_of(Parameter parameter) {
  const auto* const need = std::ranges::find_if(needs, [&](const Need& each) {
    return std::ranges::find(each.parameters, parameter) != each.parameters.end();
  });
  return need == needs.end() ? nullptr : &*need;
}

/// A limit in as few digits as do not exceed it, so that what the text says is accepted.
std::string allowed_text(double limit) {
  std::string text;
  double shown = std::numeric_limits<double>::infinity();
  for (int num_digits = 3; shown > limit; ++num_digits) {
    text = fmt::format("{:.{}g}", limit, num_digits);
    std::from_chars(text.data(), text.data() + text.size(), shown);
  }
  return text;
}

/// Whether at most one excitation pushes the satellite or moves masses. Along Y and Z they shake X
/// as well, by misalignment and gradient.
bool shakes_once(const Session& session) {
  return std::ranges::count_if(session.excitations, [](const Excitation& excitation) {
           return excitation.kind != ExcitationKind::attitude;
         }) <= 1;
}

/// Of an excitation of a session, in its own unit; infinite if `joint` takes any.
double amplitude_max(const Session& session, const Excitation& excitation,
                     const PushLimits& limits) {
  if (excitation.kind == ExcitationKind::test_mass) return joint_motion_max_m;
  if (!pushes_along_x(excitation)) return std::numeric_limits<double>::infinity();
  return shakes_once(session) ? limits.alone_along_x : limits.beside_others;
}

}  // namespace

std::string_view what_determines(Parameter parameter) {
  const Need* const need = need_of(parameter);
  return need == nullptr ? std::string_view() : need->what;
}

bool may_be_larger(const std::vector<Session>& sessions, Parameter parameter,
                   const PushLimits& limits) {
  const Need* const need = need_of(parameter);
  if (need == nullptr) return false;
  return std::ranges::any_of(sessions, [&](const Session& session) {
    return std::ranges::any_of(session.excitations, [&](const Excitation& excitation) {
      return need->is_it(excitation) &&
             excitation.amplitude < amplitude_max(session, excitation, limits);
    });
  });
}

void check_joint(const std::vector<Session>& sessions) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    if (sessions[i].spin_rate_rad_s == 0.0 || is_test(sessions[i])) continue;
    throw ConfigError(fmt::format("session[{}].spin_rate_rad_s", i),
                      fmt::format("{}", sessions[i].spin_rate_rad_s),
                      "estimation.method = \"joint\" needs 0");
  }
  std::vector<std::string> lacks;
  for (const Need& need : needs) {
    const bool is_met = std::ranges::any_of(sessions, [&](const Session& session) {
      return std::ranges::any_of(session.excitations, need.is_it);
    });
    if (!is_met) lacks.push_back(fmt::format("one that {}", need.what));
  }
  if (lacks.empty()) return;
  throw ConfigError("session",
                    fmt::format("{} session{}", sessions.size(), sessions.size() == 1 ? "" : "s"),
                    fmt::format("estimation.method = \"joint\" needs {}", fmt::join(lacks, ", ")));
}

int joint_orbits_min(double orbit_period_s, double transient_s) {
  return 1 + static_cast<int>(std::ceil(transient_s / orbit_period_s));
}

void check_joint_records(const std::vector<Session>& sessions, double orbit_period_s,
                         double transient_s) {
  const int num_orbits_min = joint_orbits_min(orbit_period_s, transient_s);
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const int num_orbits = sessions[i].num_orbits;
    if (is_test(sessions[i]) || num_orbits >= num_orbits_min) continue;
    throw ConfigError(
        fmt::format("session[{}].orbits", i), fmt::format("{}", num_orbits),
        fmt::format("estimation.method = \"joint\" needs {} or more: less estimation.transient_s "
                    "= {} the record of session {} is {:.6g} s long, and must be an orbit, {} s",
                    num_orbits_min, transient_s, sessions[i].name,
                    num_orbits * orbit_period_s - transient_s, orbit_period_s));
  }
}

PushLimits push_limits(const DrawnMoments& laws, double a_d11_objective) {
  const std::size_t first = draw_group("quadratic_factor_s2_m").first;
  double mean_square = 0.0;
  for (const std::size_t sensor_x : {first, first + 3}) {
    const auto at = static_cast<Eigen::Index>(sensor_x);
    mean_square += 0.5 * (laws.covariance(at, at) + laws.mean[sensor_x] * laws.mean[sensor_x]);
  }
  const double part = a_d11_objective / 50.0;
  return {.alone_along_x = std::sqrt(std::sqrt(part / 8.75) / mean_square),
          .beside_others = std::sqrt(part / 1.5 / mean_square)};
}

void check_joint_motions(const std::vector<Session>& sessions) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const std::vector<Excitation>& excitations = sessions[i].excitations;
    for (std::size_t k = 0; k < excitations.size(); ++k) {
      if (excitations[k].kind != ExcitationKind::test_mass) continue;
      if (excitations[k].amplitude <= joint_motion_max_m) continue;
      throw ConfigError(fmt::format("session[{}].excitations[{}].amplitude_m", i, k),
                        fmt::format("{}", excitations[k].amplitude),
                        fmt::format("must be <= {} for estimation.method = \"joint\": of larger "
                                    "motions errors exceed the standard errors",
                                    joint_motion_max_m));
    }
  }
}

void check_joint_pushes(const std::vector<Session>& sessions, const PushLimits& limits) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const std::vector<Excitation>& excitations = sessions[i].excitations;
    for (std::size_t k = 0; k < excitations.size(); ++k) {
      const double limit_m_s2 = amplitude_max(sessions[i], excitations[k], limits);
      if (!pushes_along_x(excitations[k]) || excitations[k].amplitude <= limit_m_s2) continue;
      throw ConfigError(
          fmt::format("session[{}].excitations[{}].amplitude_m_s2", i, k),
          fmt::format("{}", excitations[k].amplitude),
          fmt::format(
              "must be <= {} for estimation.method = \"joint\"{}", allowed_text(limit_m_s2),
              shakes_once(sessions[i])
                  ? ": beyond, what K2 makes of it and the model leaves out may move a_d11' "
                    "by 1/50 of its objective"
                  : " beside the session's other excitations: beyond, errors exceed the "
                    "standard errors"));
    }
  }
}

}  // namespace proofmass
