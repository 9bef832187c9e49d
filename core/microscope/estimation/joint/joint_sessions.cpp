#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/estimation/joint/joint.hpp"

namespace proofmass {
namespace {

/// factor·f of an excitation plus orbital·f_orb.
LineMultiple multiple(std::size_t excitation, double factor, double orbital) {
  LineMultiple line{.orbital = orbital};
  (excitation == 0 ? line.excitation : line.further[excitation - 1]) = factor;
  return line;
}

bool moves_apart(const Excitation& excitation) {
  return excitation.kind == ExcitationKind::test_mass && excitation.axis != Axis::x &&
         excitation.motion == MassMotion::opposition;
}

/// Whether the squares of Γ_mes,kx tell at 2 f of K2.
bool tells_of_squares(const Excitation& excitation) {
  if (excitation.axis != Axis::x) return false;
  return excitation.kind == ExcitationKind::drag_free ||
         (excitation.kind == ExcitationKind::test_mass &&
          excitation.motion != MassMotion::opposition);
}

/// Two that shake X make lines at sum and difference of their frequencies, of K2 times both: 1e-11
/// m/s², which tell no more than the squares do, and leak.
void add_products(const std::vector<Excitation>& excitations, RecordNeeds& needs) {
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    for (std::size_t j = i + 1; j < excitations.size(); ++j) {
      if (!tells_of_squares(excitations[i]) || !tells_of_squares(excitations[j])) continue;
      for (const double sign : {1.0, -1.0}) {
        LineMultiple product = multiple(i, 1.0, 0.0);
        product.further[j - 1] = sign;
        needs.neighbours.push_back(product);
      }
    }
  }
}

}  // namespace

RecordNeeds joint_needs(const Session& session) {
  RecordNeeds needs{.signals = SignalSet::health};
  if (is_test(session)) return needs;
  const std::vector<Excitation>& excitations = session.excitations;
  needs.lines.push_back({{.orbital = 2.0}, LineSignals::gradients});
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind == ExcitationKind::test_mass) continue;
    needs.lines.push_back({multiple(i, 1.0, 0.0), LineSignals::gradients});
  }
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!tells_of_squares(excitations[i])) continue;
    needs.lines.push_back({multiple(i, 2.0, 0.0), LineSignals::squares});
  }
  const MassExcitations motions = mass_excitations(session);
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (!moves_apart(excitations[i])) continue;
    const bool is_first = &excitations[i] == motions[0];
    for (const double orbital : {2.0, -2.0}) {
      needs.lines.push_back(
          {multiple(i, 1.0, orbital), is_first ? LineSignals::moved : LineSignals::moved_again});
    }
  }
  // Lines of which the model of another line has no term: they must not leak into it. A line that
  // the model describes may leak, because its signals leak alike.
  needs.neighbours = {{.orbital = 1.0}, {.orbital = 3.0}};
  for (std::size_t i = 0; i < excitations.size(); ++i) {
    if (excitations[i].kind != ExcitationKind::test_mass) continue;
    for (const double orbital : {0.0, 2.0, -2.0}) {
      needs.neighbours.push_back(multiple(i, 1.0, orbital));
    }
    // The signals of one motion do not tell what leaks from the other one.
    if (motions[1] == nullptr) continue;
    for (const double orbital : {1.0, -1.0, 3.0, -3.0}) {
      needs.neighbours.push_back(multiple(i, 1.0, orbital));
    }
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

}  // namespace

std::string_view what_determines(Parameter parameter) {
  const auto is_for = [&](const Need& need) {
    return std::ranges::find(need.parameters, parameter) != need.parameters.end();
  };
  const auto* const need = std::ranges::find_if(needs, is_for);
  return need == needs.end() ? std::string_view() : need->what;
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

void check_joint_orbit(double eccentricity) {
  constexpr double eccentricity_max = 0.1;
  if (eccentricity <= eccentricity_max) return;
  throw ConfigError("orbit.eccentricity", fmt::format("{}", eccentricity),
                    fmt::format("must be <= {} for estimation.method = \"joint\", whose equations "
                                "leave out its square",
                                eccentricity_max));
}

}  // namespace proofmass
