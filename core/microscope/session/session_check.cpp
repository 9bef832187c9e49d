#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "core/campaign/field.hpp"
#include "core/error.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {
namespace {

constexpr std::size_t name_length_max = 64;
constexpr double multiple_max = 1000.0;
// Of a test: a batch of runs has weights of its windows, four bytes each, 95 MB.
constexpr int num_test_orbits_max = 1000;

template <typename Choice>
std::string spelling(Choice choice) {
  const auto names = names_of(choice);
  const auto position = static_cast<std::size_t>(choice) - 1;
  return position < names.size() ? std::string(names[position])
                                 : std::to_string(static_cast<int>(choice));
}

/// Checks one session; `path_` is its place in the list, `session[3]`.
class SessionCheck {
 public:
  SessionCheck(const Session& session, std::size_t position, double orbit_period_s,
               double sample_period_s)
      : session_(session),
        path_(fmt::format("session[{}]", position)),
        orbit_period_s_(orbit_period_s),
        nyquist_hz_(0.5 / sample_period_s) {}

  void run() const {
    check_name();
    check_number("orbits", session_.num_orbits, range::between(1, 10'000));
    check_number("spin_rate_rad_s", session_.spin_rate_rad_s, range::between(-0.05, 0.05));
    check_target();
    check_excitations();
    is_test(session_) ? check_test() : check_lines();
  }

 private:
  [[noreturn]] void refuse(std::string_view key, std::string_view value,
                           std::string_view rule) const {
    throw ConfigError(fmt::format("{}.{}", path_, key), value, rule);
  }

  void check_number(std::string_view key, double value, const Range& range) const {
    check_field(FieldInfo{fmt::format("{}.{}", path_, key), "", range}, value);
  }

  template <typename Choice>
  void check_choice(std::string_view key, Choice choice, Choice needed) const {
    if (choice == needed) return;
    refuse(key, spelling(choice),
           fmt::format("target {} needs {}", name_of(session_.target), spelling(needed)));
  }

  void check_name() const {
    const auto allowed = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    };
    const std::string& name = session_.name;
    if (!name.empty() && name.size() <= name_length_max && std::ranges::all_of(name, allowed)) {
      return;
    }
    refuse("name", fmt::format("\"{:.100}\"", name),
           fmt::format("must be 1 to {} letters, digits or _", name_length_max));
  }

  void check_target() const {
    if (index(session_.target) < num_session_targets) return;
    refuse("target", spelling(session_.target), "unknown target");
  }

  void check_excitations() const;
  void check_stimulus(const Excitation& excitation, const Stimulus& needed) const;
  void check_excitation(std::size_t i) const;
  void check_lines() const;
  void check_test() const;
  void check_multiple(const std::string& key, const LineMultiple& line) const;
  void check_frequency(const std::string& key, const LineMultiple& line) const;

  const Session& session_;
  std::string path_;
  double orbit_period_s_;
  double nyquist_hz_;
};

void SessionCheck::check_excitations() const {
  const TargetInfo& target = target_info(session_.target);
  if (target.drag_free) check_choice("drag_free", session_.drag_free, *target.drag_free);
  const std::vector<Excitation>& excitations = session_.excitations;
  const auto refuse_number = [&](std::string_view rule) {
    refuse("excitations", fmt::format("{} of them", excitations.size()), rule);
  };
  const bool needs_stimulus = target.excitations == ExcitationRule::stimulus;
  if (needs_stimulus && excitations.empty()) {
    refuse_number(fmt::format("target {} needs one or more", target.name));
  }
  if (target.excitations == ExcitationRule::none && !excitations.empty()) {
    refuse_number(fmt::format("target {} needs none", target.name));
  }
  if (excitations.size() > num_excitations_max) {
    refuse_number(fmt::format("must be at most {}", num_excitations_max));
  }
  if (needs_stimulus) check_stimulus(excitations.front(), target.stimulus);
  for (std::size_t i = 0; i < excitations.size(); ++i) check_excitation(i);
}

void SessionCheck::check_stimulus(const Excitation& excitation, const Stimulus& needed) const {
  const std::string key = "excitations[0].";
  check_choice(key + "kind", excitation.kind, needed.kind);
  check_choice(key + "axis", excitation.axis, needed.axis);
  check_choice(key + "moves", excitation.motion, needed.motion);
}

void SessionCheck::check_excitation(std::size_t i) const {
  const Excitation& excitation = session_.excitations[i];
  const std::string key = fmt::format("excitations[{}].", i);
  check_number(key + std::string(amplitude_key(excitation.kind)), excitation.amplitude,
               range::positive);
  // The quadratic factors show at twice the excitation's frequency, which must be seen too.
  check_number(key + "frequency_hz", excitation.frequency_hz,
               Range{.minimum = 0.0, .maximum = nyquist_hz_ / 2, .minimum_open = true});
  const Excitation* const first = mass_excitation(session_);
  if (excitation.kind != ExcitationKind::test_mass || &excitation == first) return;
  const bool are_apart = excitation.motion == MassMotion::opposition &&
                         first->motion == MassMotion::opposition && excitation.axis != Axis::x &&
                         first->axis != Axis::x && excitation.axis != first->axis;
  if (are_apart && &excitation == mass_excitations(session_)[1]) return;
  refuse(key + "kind", spelling(excitation.kind),
         "a second one that moves test masses needs both in opposition, along y and along z");
}

void SessionCheck::check_lines() const {
  if (session_.fit_lines.empty()) refuse("fit_lines", "[]", "must name one line or more");
  if (session_.fit_lines.size() > num_fit_lines_max) {
    refuse("fit_lines", fmt::format("{} lines", session_.fit_lines.size()), "must be one or two");
  }
  const std::size_t num_lines = session_.fit_lines.size() + session_.known_lines.size();
  if (num_lines > num_session_lines_max) {
    refuse("known_lines", fmt::format("{} lines with fit_lines", num_lines),
           fmt::format("must be at most {}", num_session_lines_max));
  }
  // Closer lines cannot be told apart in the session's time. A part in 10⁹ absorbs rounding where
  // they are exactly that close: neighbouring multiples of f_orb in a session of one orbit.
  const double resolution_hz = (1.0 - 1e-9) / (session_.num_orbits * orbit_period_s_);
  std::vector<std::pair<std::string, double>> earlier{{"the mean", 0.0}};
  const auto check_list = [&](std::string_view list, const std::vector<LineMultiple>& lines) {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::string key = fmt::format("{}[{}]", list, i);
      check_multiple(key, lines[i]);
      check_frequency(key, lines[i]);
      const double frequency_hz = line_frequency_hz(session_, lines[i], orbit_period_s_);
      for (const auto& [other_key, other_hz] : earlier) {
        if (std::abs(frequency_hz - other_hz) >= resolution_hz) continue;
        refuse(key, text_of(lines[i]),
               fmt::format("must be 1/({} orbits) or more away from {}", session_.num_orbits,
                           other_key));
      }
      earlier.emplace_back(key, frequency_hz);
    }
  };
  check_list("fit_lines", session_.fit_lines);
  check_list("known_lines", session_.known_lines);
}

void SessionCheck::check_test() const {
  const auto refuse_lines = [&](std::string_view key, const std::vector<LineMultiple>& lines) {
    if (lines.empty()) return;
    refuse(key, fmt::format("{} lines", lines.size()),
           "target ep_test has lines of its own, f_EP and 2 f_EP: leave this out");
  };
  refuse_lines("fit_lines", session_.fit_lines);
  refuse_lines("known_lines", session_.known_lines);
  if (session_.num_orbits > num_test_orbits_max) {
    refuse("orbits", fmt::format("{}", session_.num_orbits),
           fmt::format("must be at most {} with the target ep_test", num_test_orbits_max));
  }
  // A frame that turns with the Earth's direction sees a constant, which a bias is, too.
  const double resolution_hz = (1.0 - 1e-9) / (session_.num_orbits * orbit_period_s_);
  if (test_frequency_hz(session_, orbit_period_s_) >= resolution_hz) return;
  refuse("spin_rate_rad_s", fmt::format("{}", session_.spin_rate_rad_s),
         fmt::format("must leave f_EP = |f_orb + f_spin| at 1/({} orbits) or more",
                     session_.num_orbits));
}

void SessionCheck::check_multiple(const std::string& key, const LineMultiple& line) const {
  const Range multiples = range::between(-multiple_max, multiple_max);
  const auto check = [&](double multiple) {
    if (multiples.contains(multiple)) return;
    refuse(key, text_of(line), fmt::format("must be multiples from -{0} to {0}", multiple_max));
  };
  for (const double multiple : {line.orbital, line.excitation, line.spin}) check(multiple);
  for (std::size_t i = 0; i < line.further.size(); ++i) {
    check(line.further[i]);
    if (line.further[i] == 0.0 || i + 1 < session_.excitations.size()) continue;
    refuse(key, text_of(line),
           fmt::format("the session has no excitations[{}] to take a multiple of", i + 1));
  }
  if (line.excitation != 0.0 && session_.excitations.empty()) {
    refuse(key, text_of(line), "the session has no excitation to take a multiple of");
  }
  if (line.spin != 0.0 && session_.spin_rate_rad_s == 0.0) {
    refuse(key, text_of(line), "the session has no spin to take a multiple of");
  }
}

void SessionCheck::check_frequency(const std::string& key, const LineMultiple& line) const {
  const double frequency_hz = line_frequency_hz(session_, line, orbit_period_s_);
  if (frequency_hz > 0.0 && frequency_hz < nyquist_hz_) return;
  refuse(key, text_of(line),
         fmt::format("is at {:.6g} Hz, must be between 0 and the Nyquist frequency, {} Hz",
                     frequency_hz, nyquist_hz_));
}

void check_unique_names(const std::vector<Session>& sessions) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (sessions[i].name != sessions[j].name) continue;
      throw ConfigError(fmt::format("session[{}].name", i), fmt::format("\"{}\"", sessions[i].name),
                        fmt::format("is the name of session[{}] already", j));
    }
  }
}

/// One a_d11' cannot hold what two kinds of constant accelerations make.
void check_one_drag_free(const std::vector<Session>& sessions) {
  const DragFreeSource first = drag_free_of_a_d11_prime(sessions);
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const bool is_other =
        sessions[i].target == SessionTarget::a_d11_prime && sessions[i].drag_free != first;
    if (!is_other) continue;
    throw ConfigError(
        fmt::format("session[{}].drag_free", i), spelling(sessions[i].drag_free),
        fmt::format("all sessions with the target a_d11_prime need one, {}", spelling(first)));
  }
}

}  // namespace

void validate_sessions(const std::vector<Session>& sessions, double orbit_period_s,
                       double sample_period_s) {
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    SessionCheck(sessions[i], i, orbit_period_s, sample_period_s).run();
  }
  check_unique_names(sessions);
  check_one_drag_free(sessions);
}

}  // namespace proofmass
