#include <fmt/format.h>

#include <optional>

#include "core/microscope/definition/readers.hpp"
#include "core/microscope/session/session_names.hpp"

namespace proofmass::detail {
namespace {

// Far more than the sessions of a valid campaign have: they bound what hostile texts cost.
constexpr std::size_t sessions_max = 64;
constexpr std::size_t excitations_max = 16;
constexpr std::size_t lines_max = 64;

constexpr ExcitationKind excitation_kinds[] = {ExcitationKind::attitude, ExcitationKind::drag_free,
                                               ExcitationKind::test_mass};

template <typename Value>
bool read_needed(Document& document, const std::string& path, Value& value) {
  const bool is_absent = document.find(path) == nullptr;
  if (is_absent) document.refuse_absence(path, "every one needs it");
  return !is_absent && document.read(path, value);
}

bool read_multiple(const toml::node& entry, double& multiple) {
  const std::optional<double> value = entry.value<double>();
  if (!value || !entry.is_number()) return false;
  multiple = *value + 0.0;  // The canonical text has no -0 here, which would mean the same.
  return true;
}

// Of one excitation, or of each in a list.
bool read_excitation_multiples(const toml::node& entry, LineMultiple& line) {
  const toml::array* const list = entry.as_array();
  if (list == nullptr) return read_multiple(entry, line.excitation);
  if (list->empty() || list->size() > num_excitations_max) return false;
  for (std::size_t i = 0; i < list->size(); ++i) {
    if (!read_multiple((*list)[i], i == 0 ? line.excitation : line.further[i - 1])) return false;
  }
  return true;
}

std::optional<LineMultiple> line_of(const toml::node& entry) {
  const toml::array* const multiples = entry.as_array();
  if (multiples == nullptr || multiples->size() < 2 || multiples->size() > 3) return std::nullopt;
  LineMultiple line;
  const bool is_read = read_multiple((*multiples)[0], line.orbital) &&
                       read_excitation_multiples((*multiples)[1], line) &&
                       (multiples->size() < 3 || read_multiple((*multiples)[2], line.spin));
  if (!is_read) return std::nullopt;
  return line;
}

void read_lines(Document& document, const std::string& path, std::vector<LineMultiple>& lines) {
  const toml::node* const found = document.find(path);
  if (found == nullptr) return;
  const toml::array* const list = found->as_array();
  if (list == nullptr) return document.refuse(path, "must be a list such as [[2, 0], [0, 1]]");
  if (list->size() > lines_max) {
    return document.refuse(path, fmt::format("must have at most {} entries", lines_max));
  }
  for (std::size_t i = 0; i < list->size(); ++i) {
    const std::optional<LineMultiple> line = line_of((*list)[i]);
    if (!line) {
      document.refuse(fmt::format("{}[{}]", path, i),
                      "must be two or three numbers, the multiples of f_orb, of the excitation and "
                      "of the spin");
      return;
    }
    lines.push_back(*line);
  }
}

void read_amplitude(Document& document, const std::string& path, Excitation& excitation) {
  const std::string key(amplitude_key(excitation.kind));
  read_needed(document, path + "." + key, excitation.amplitude);
  const std::string kind(names_of(excitation.kind)[static_cast<std::size_t>(excitation.kind) - 1]);
  for (const ExcitationKind other : excitation_kinds) {
    if (other == excitation.kind) continue;
    const std::string other_path = fmt::format("{}.{}", path, amplitude_key(other));
    if (document.find(other_path) == nullptr) continue;
    document.refuse(other_path, fmt::format("not a key of kind {}, which has {}", kind, key));
  }
}

Excitation read_excitation(Document& document, const std::string& path) {
  Excitation excitation;
  const bool has_kind = read_needed(document, path + ".kind", excitation.kind);
  read_needed(document, path + ".axis", excitation.axis);
  read_needed(document, path + ".frequency_hz", excitation.frequency_hz);
  if (has_kind) {
    read_amplitude(document, path, excitation);
  } else {
    // Which amplitude belongs here is not known: none is an unknown key.
    for (const ExcitationKind kind : excitation_kinds) {
      (void)document.find(fmt::format("{}.{}", path, amplitude_key(kind)));
    }
  }
  const bool has_motion = document.read(path + ".moves", excitation.motion);
  if (has_motion && excitation.kind != ExcitationKind::test_mass) {
    document.refuse(path + ".moves", "only with kind = \"test_mass\"");
  }
  return excitation;
}

Session read_session(Document& document, const std::string& path) {
  Session session;
  read_needed(document, path + ".name", session.name);
  read_needed(document, path + ".target", session.target);
  document.read(path + ".orbits", session.num_orbits);
  document.read(path + ".spin_rate_rad_s", session.spin_rate_rad_s);
  document.read(path + ".drag_free", session.drag_free);
  const std::size_t num_excitations =
      document.num_tables(path + ".excitations", excitations_max).value_or(0);
  for (std::size_t i = 0; i < num_excitations; ++i) {
    session.excitations.push_back(
        read_excitation(document, fmt::format("{}.excitations[{}]", path, i)));
  }
  read_lines(document, path + ".fit_lines", session.fit_lines);
  read_lines(document, path + ".known_lines", session.known_lines);
  return session;
}

}  // namespace

std::vector<Session> read_sessions(Document& document) {
  const std::optional<std::size_t> num_sessions = document.num_tables("session", sessions_max);
  if (!num_sessions) return hardy2013_sessions();
  std::vector<Session> sessions;
  for (std::size_t i = 0; i < *num_sessions; ++i) {
    sessions.push_back(read_session(document, fmt::format("session[{}]", i)));
  }
  return sessions;
}

}  // namespace proofmass::detail
