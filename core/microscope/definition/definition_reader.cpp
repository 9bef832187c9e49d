#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/definition/document.hpp"
#include "core/definition/law_reader.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/definition/definition_entries.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {
namespace {

using namespace detail;

// Each part asks the document for its keys and completes what is absent with the nominal values.
// What is wrong is remembered by the document, and found by Document::check().

struct FieldReader {
  Document& document;

  void operator()(const FieldInfo& field, double& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  void operator()(const FieldInfo& field, std::int64_t& value) const {
    document.read(std::string(field.path), value, field.range);
  }
  template <typename Choice>
  void operator()(const FieldInfo& field, Choice& value) const {
    document.read(std::string(field.path), value);
  }
};

/// Refuses what the fields of tests are where no session tests.
void refuse_fields_of_tests(Document& document) {
  std::set<std::string> others;
  Scenario scenario;
  for_each_field(scenario, [&](const FieldInfo& field, auto&) { others.emplace(field.path); });
  scenario.sessions.emplace_back().target = SessionTarget::ep_test;
  for_each_field(scenario, [&](const FieldInfo& field, auto&) {
    const std::string path(field.path);
    if (others.contains(path) || document.find(path) == nullptr) return;
    document.refuse(path,
                    "only where a session tests the equivalence principle: none has the "
                    "target ep_test");
  });
}

/// Numbers and choices of the scenario, all but its sessions.
void read_scenario(Document& document, Scenario& scenario) {
  // The preset sets the values that the other keys of noise then replace.
  NoisePreset preset = scenario.noise.preset;
  document.read("noise.preset", preset);
  scenario.noise = noise_preset(preset);
  if (document.has_table("realism")) scenario.realism.emplace();
  for_each_field(scenario, FieldReader{document});
  if (!scenario.has_tests()) refuse_fields_of_tests(document);
  if (document.find("health") == nullptr) return;
  document.refuse("health", "delete this table: what loses a run follows from its objectives");
}

// Far more than the sessions of a valid campaign have: they bound what hostile texts cost.
constexpr std::size_t sessions_max = 64;
constexpr std::size_t excitations_max = 16;
constexpr std::size_t lines_max = 64;
constexpr std::size_t controllers_max = 6;

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
  for (const ExcitationKind other : excitation_kinds) {
    if (other == excitation.kind) continue;
    const std::string other_path = fmt::format("{}.{}", path, amplitude_key(other));
    if (document.find(other_path) == nullptr) continue;
    document.refuse(other_path, fmt::format("not a key of kind {}, which has {}",
                                            name_of(excitation.kind), key));
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

/// The list `session`, or the paper's sessions if the file has none.
std::vector<Session> read_sessions(Document& document) {
  const std::optional<std::size_t> num_sessions = document.num_tables("session", sessions_max);
  if (!num_sessions) return hardy2013_sessions();
  std::vector<Session> sessions;
  for (std::size_t i = 0; i < *num_sessions; ++i) {
    sessions.push_back(read_session(document, fmt::format("session[{}]", i)));
  }
  return sessions;
}

void read_roots(Document& document, const std::string& path,
                std::vector<std::complex<double>>& roots) {
  const toml::node* const found = document.find(path);
  if (found == nullptr) return;
  const toml::array* const list = found->as_array();
  constexpr std::string_view rule = "must be a list such as [[-0.3, 0], [-0.1, 0.2], [-0.1, -0.2]]";
  if (list == nullptr || list->size() > controller_order_max) return document.refuse(path, rule);
  for (const toml::node& entry : *list) {
    const toml::array* const parts = entry.as_array();
    double real = 0.0, imaginary = 0.0;
    if (parts == nullptr || parts->size() != 2 || !read_multiple((*parts)[0], real) ||
        !read_multiple((*parts)[1], imaginary)) {
      return document.refuse(path, rule);
    }
    roots.emplace_back(real, imaginary);
  }
}

/// The list `controller`.
std::vector<ControllerConfig> read_controllers(Document& document) {
  std::vector<ControllerConfig> controllers;
  const std::size_t num_controllers =
      document.num_tables("controller", controllers_max).value_or(0);
  for (std::size_t i = 0; i < num_controllers; ++i) {
    const std::string path = fmt::format("controller[{}]", i);
    ControllerConfig& controller = controllers.emplace_back();
    read_needed(document, path + ".loop", controller.loop);
    read_needed(document, path + ".axis", controller.axis);
    read_needed(document, path + ".gain", controller.gain);
    read_roots(document, path + ".zeros_rad_s", controller.zeros_rad_s);
    read_roots(document, path + ".poles_rad_s", controller.poles_rad_s);
    document.read(path + ".delay_samples", controller.delay_samples, range::between(0, 240));
  }
  return controllers;
}

/// Laws of `[dispersion.<group>]` and, over them, of `[dispersion.<group>.<element>]`.
DispersionSet read_dispersions(Document& document) {
  DispersionSet dispersions = nominal_dispersions();
  std::vector<std::size_t> with_covariances;
  for (const DrawGroup& group : draw_groups()) {
    const std::string path = fmt::format("dispersion.{}", group.name);
    const bool is_assigned = document.is_assigned(path + ".law");
    const Dispersion of_group = read_law(document, path, dispersions[group.first], is_assigned);
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      const std::string element = fmt::format("dispersion.{}", drawn_names()[i]);
      const bool follows_group = document.find(element + ".law") == nullptr;
      dispersions[i] =
          read_law(document, element, of_group,
                   follows_group ? is_assigned : document.is_assigned(element + ".law"));
      if (dispersions[i].law != Law::correlated) continue;
      const bool has_own = document.find(element + ".correlations") != nullptr;
      if (has_covariances(document, element) || (!has_own && has_covariances(document, path))) {
        with_covariances.push_back(i);
      }
    }
  }
  for (const std::size_t i : with_covariances) {
    as_correlations(law_set(dispersions), dispersions[i]);
  }
  return dispersions;
}

}  // namespace

MicroscopeCampaign read_definition(Document& document) {
  MicroscopeCampaign campaign;
  campaign.scenario = hardy2013_campaign().scenario;  // What is left out stays what `init` writes.
  read_identity(document, campaign);
  document.read("environment.file", campaign.environment_file);
  campaign.scenario.sessions = read_sessions(document);  // Some fields are those of tests.
  read_scenario(document, campaign.scenario);
  campaign.scenario.controllers = read_controllers(document);
  campaign.dispersions = read_dispersions(document);
  return campaign;
}

}  // namespace proofmass
