#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/definition/document.hpp"
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

/// Numbers and choices of the scenario, all but its sessions.
void read_scenario(Document& document, Scenario& scenario) {
  // The preset sets the values that the other keys of noise then replace.
  NoisePreset preset = scenario.noise.preset;
  document.read("noise.preset", preset);
  scenario.noise = noise_preset(preset);
  for_each_field(scenario, FieldReader{document});
  if (document.find("health") == nullptr) return;
  document.refuse("health", "delete this table: what loses a run follows from its objectives");
}

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

constexpr std::string_view independent_key = "independent";
constexpr std::string_view covariances_key = "covariances";  // In place of correlations.
constexpr std::array<std::string_view, 14> all_keys{
    "minimum",       "maximum",      "mean", "standard_deviation", "value",        "file",
    "column",        "values",       "with", "probabilities",      "correlations", "expression",
    independent_key, covariances_key};

// The only key of a law that may be absent: a table is no draw unless somebody says so.
void read_independence(Document& document, const std::string& path, Dispersion& dispersion) {
  const toml::node* const found = document.find(path);
  if (found == nullptr) return;
  if (!found->is_boolean()) return document.refuse(path, "must be true or false");
  dispersion.is_independent = found->value_or(false);
}

/// Reads a list of numbers or of texts.
template <typename Item>
bool read_list(Document& document, const std::string& path, std::string_view rule,
               std::vector<Item>& items) {
  const toml::node* const found = document.find(path);
  if (found == nullptr) return false;
  const toml::array* const list = found->as_array();
  bool is_list = list != nullptr && list->size() <= law_list_size_max;
  std::vector<Item> read;
  for (std::size_t i = 0; is_list && i < list->size(); ++i) {
    const std::optional<Item> item = (*list)[i].template value<Item>();
    is_list = item.has_value() && !(*list)[i].is_boolean();
    if (is_list) read.push_back(*item);
  }
  if (!is_list) {
    document.refuse(path, fmt::format("must be a list of at most {} {}", law_list_size_max, rule));
    return false;
  }
  items = std::move(read);
  return true;
}

bool read_key(Document& document, const std::string& path, std::string_view key,
              Dispersion& dispersion) {
  if (double* const number = number_at(dispersion, key)) return document.read(path, *number);
  if (auto* const numbers = numbers_at(dispersion, key)) {
    return read_list(document, path, "numbers", *numbers);
  }
  if (auto* const texts = texts_at(dispersion, key)) {
    return read_list(document, path, "names of drawn quantities", *texts);
  }
  return document.read(path, *text_at(dispersion, key));
}

/// Centre of the law that an assignment replaces: by its keys in the file, or else that of `law`.
double replaced_centre(Document& document, const std::string& path, Dispersion law) {
  const auto has = [&](std::string_view key) {
    return read_key(document, fmt::format("{}.{}", path, key), key, law);
  };
  if (has("value")) return law.value;
  if (has("mean")) return law.mean;
  const bool has_minimum = has("minimum");
  const bool has_bounds = has("maximum") && has_minimum;
  if (has_bounds || law.law == Law::uniform) return 0.5 * law.minimum + 0.5 * law.maximum;
  return law.law == Law::fixed ? law.value : law.mean;
}

// Keys that belong to other laws: a mean beside a uniform law would be silently without effect.
// Keys of a law in the file that an assignment replaces are gone with it.
void refuse_other_keys(Document& document, const std::string& path, Law law, bool is_assigned) {
  const std::span<const std::string_view> keys = keys_of(law);
  for (const std::string_view key : all_keys) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (std::ranges::find(keys, key) != keys.end()) continue;
    if (law == Law::table && key == independent_key) continue;
    if (law == Law::correlated && key == covariances_key) continue;
    if (document.find(key_path) == nullptr) continue;
    if (is_assigned && !document.is_assigned(key_path)) continue;
    document.refuse(key_path, fmt::format("not a key of law {}, which has {}", name_of(law),
                                          fmt::join(keys, ", ")));
  }
}

/// Reads covariances, which stand for correlations until as_correlations() divides them.
bool read_covariances(Document& document, const std::string& path, Dispersion& dispersion) {
  const std::string key_path = fmt::format("{}.{}", path, covariances_key);
  if (document.find(key_path) == nullptr) return false;
  if (document.find(path + ".correlations") != nullptr) {
    document.refuse(key_path, "stands in place of correlations: leave out one of them");
  } else {
    (void)read_list(document, key_path, "numbers", dispersion.correlations);
  }
  return true;
}

/// Divides covariances by the standard deviations of both quantities. What is no drawn quantity is
/// left to be refused.
void as_correlations(const DispersionSet& dispersions, Dispersion& dispersion) {
  for (std::size_t k = 0; k < dispersion.correlations.size(); ++k) {
    if (k >= dispersion.with.size()) return;
    const auto with = std::ranges::find(drawn_names(), dispersion.with[k]);
    if (with == drawn_names().end()) continue;
    const auto place = static_cast<std::size_t>(with - drawn_names().begin());
    dispersion.correlations[k] /=
        dispersion.standard_deviation * dispersions[place].standard_deviation;
  }
}

// The law at `path` where it differs from an outer one, `base`.
Dispersion read_dispersion(Document& document, const std::string& path, const Dispersion& base,
                           bool is_assigned) {
  Law law = base.law;
  const bool has_law = document.read(path + ".law", law);
  const bool is_law_refused = !has_law && document.find(path + ".law") != nullptr;
  if (is_law_refused) {
    for (const std::string_view key : all_keys)
      (void)document.find(fmt::format("{}.{}", path, key));
    return base;
  }
  Dispersion dispersion = law == base.law ? base : Dispersion{};
  dispersion.law = law;
  for (const std::string_view key : keys_of(law)) {
    const std::string key_path = fmt::format("{}.{}", path, key);
    if (key == "correlations" && read_covariances(document, path, dispersion)) continue;
    if (document.find(key_path) != nullptr || law == base.law) {
      read_key(document, key_path, key, dispersion);
    } else if (is_assigned && (key == "value" || key == "mean") && base.law != Law::table) {
      *number_at(dispersion, key) = replaced_centre(document, path, base);
    } else {
      document.refuse_absence(
          key_path, fmt::format("law {} needs it{}", name_of(law),
                                is_assigned ? ": --set " + key_path + "=..." : std::string()));
    }
  }
  if (law == Law::table) {
    read_independence(document, fmt::format("{}.{}", path, independent_key), dispersion);
  }
  refuse_other_keys(document, path, law, is_assigned);
  return dispersion;
}

/// Laws of `[dispersion.<group>]` and, over them, of `[dispersion.<group>.<element>]`.
DispersionSet read_dispersions(Document& document) {
  DispersionSet dispersions = nominal_dispersions();
  std::vector<std::size_t> have_covariances;
  for (const DrawGroup& group : draw_groups()) {
    const std::string path = fmt::format("dispersion.{}", group.name);
    const bool is_assigned = document.is_assigned(path + ".law");
    const Dispersion of_group =
        read_dispersion(document, path, dispersions[group.first], is_assigned);
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      const std::string element = fmt::format("dispersion.{}", drawn_names()[i]);
      const bool follows_group = document.find(element + ".law") == nullptr;
      dispersions[i] =
          read_dispersion(document, element, of_group,
                          follows_group ? is_assigned : document.is_assigned(element + ".law"));
      if (dispersions[i].law != Law::correlated) continue;
      const bool has_own = document.find(element + ".correlations") != nullptr;
      const bool has_covariances =
          document.find(fmt::format("{}.{}", element, covariances_key)) != nullptr ||
          (!has_own && document.find(fmt::format("{}.{}", path, covariances_key)) != nullptr);
      if (has_covariances) have_covariances.push_back(i);
    }
  }
  for (const std::size_t i : have_covariances) as_correlations(dispersions, dispersions[i]);
  return dispersions;
}

void read_design(Document& document, SamplingDesign& design) {
  constexpr std::int64_t nominal_points = 32;
  document.read("campaign.design", design.kind);
  if (design.kind == DesignKind::random) {
    if (document.find("campaign.points") == nullptr) return;
    document.refuse("campaign.points", "only with campaign.design, which is \"random\"");
    return;
  }
  std::int64_t points = nominal_points;
  document.read("campaign.points", points,
                range::between(2, static_cast<double>(design_points_max)));
  design.points = static_cast<std::uint64_t>(points);
}

}  // namespace

MicroscopeCampaign read_definition(Document& document) {
  MicroscopeCampaign campaign;
  campaign.scenario = hardy2013_campaign().scenario;  // What is left out stays what `init` writes.
  document.read("campaign.name", campaign.name);
  auto seed = static_cast<std::int64_t>(campaign.seed);
  auto num_runs = static_cast<std::int64_t>(campaign.num_runs);
  document.read("campaign.seed", seed, range::not_negative);
  document.read("campaign.runs", num_runs, range::between(1, static_cast<double>(num_runs_max)));
  std::int64_t realisations = 1;
  document.read("campaign.realisations", realisations,
                range::between(1, static_cast<double>(realisations_max)));
  campaign.realisations = static_cast<std::uint64_t>(realisations);
  read_design(document, campaign.design);
  campaign.seed = static_cast<std::uint64_t>(seed);
  campaign.num_runs = static_cast<std::uint64_t>(num_runs);
  document.read("environment.file", campaign.environment_file);
  campaign.scenario.sessions = read_sessions(document);  // Some fields are those of tests.
  read_scenario(document, campaign.scenario);
  campaign.dispersions = read_dispersions(document);
  return campaign;
}

}  // namespace proofmass
