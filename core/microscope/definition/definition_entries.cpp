#include "core/microscope/definition/definition_entries.hpp"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass::detail {

std::string_view name_of(Law law) { return names_of(law)[static_cast<std::size_t>(law) - 1]; }

std::string* text_at(Dispersion& dispersion, std::string_view key) {
  if (key == "file") return &dispersion.file;
  if (key == "column") return &dispersion.column;
  if (key == "expression") return &dispersion.expression;
  return nullptr;
}

std::vector<double>* numbers_at(Dispersion& dispersion, std::string_view key) {
  if (key == "values") return &dispersion.values;
  if (key == "probabilities") return &dispersion.probabilities;
  if (key == "correlations") return &dispersion.correlations;
  return nullptr;
}

std::vector<std::string>* texts_at(Dispersion& dispersion, std::string_view key) {
  return key == "with" ? &dispersion.with : nullptr;
}

namespace {

Entry text_entry(std::string_view path, std::string_view text, std::string comment = {}) {
  return {std::string(path), quoted_text(text), std::move(comment), std::string(text)};
}

Entry real_entry(std::string_view path, double value, std::string comment = {}) {
  return {std::string(path), number_text(value), std::move(comment), value};
}

Entry whole_entry(std::string_view path, std::int64_t value, std::string comment = {}) {
  return {std::string(path), fmt::format("{}", value), std::move(comment), value};
}

template <typename Choice>
Entry choice_entry(std::string_view path, Choice choice, std::string comment = {}) {
  return text_entry(path, names_of(choice)[static_cast<std::size_t>(choice) - 1],
                    std::move(comment));
}

/// @param item_text  The text of an item.
template <typename Item, typename TextOf>
Entry list_entry(std::string_view path, const std::vector<Item>& items, const TextOf& item_text) {
  std::string text = "[";
  for (const Item& item : items) {
    if (text.size() > 1) text += ", ";
    text += item_text(item);
  }
  text += "]";
  return {std::string(path), text, "", text};
}

Entry lines_entry(std::string_view path, const std::vector<LineMultiple>& lines) {
  return list_entry(path, lines, [](const LineMultiple& line) { return text_of(line); });
}

Entry law_entry(std::string_view key, Dispersion& law) {
  if (const double* const number = number_at(law, key)) return real_entry(key, *number);
  if (const auto* const numbers = numbers_at(law, key)) {
    return list_entry(key, *numbers, number_text);
  }
  if (const auto* const texts = texts_at(law, key)) return list_entry(key, *texts, quoted_text);
  return text_entry(key, *text_at(law, key));
}

std::string inline_table(const std::vector<Entry>& entries) {
  std::string text = "{ ";
  for (const Entry& entry : entries) {
    if (text.size() > 2) text += ", ";
    text += fmt::format("{} = {}", entry.path, entry.text);
  }
  return text + " }";
}

// `Orbital period.` and `must be in [1, 2]` make `Orbital period; in [1, 2].`
std::string comment_of(const FieldInfo& field) {
  constexpr std::string_view verb = "must be ";
  std::string comment(field.comment);
  const std::string rule = field.range.rule();
  if (rule == range::any.rule()) return comment;
  if (comment.ends_with('.')) comment.pop_back();
  return fmt::format("{}; {}.", comment, rule.substr(verb.size()));
}

struct FieldWriter {
  std::vector<Entry>& entries;

  void operator()(const FieldInfo& field, const double& value) const {
    entries.push_back(real_entry(field.path, value, comment_of(field)));
  }
  void operator()(const FieldInfo& field, const std::int64_t& value) const {
    entries.push_back(whole_entry(field.path, value, comment_of(field)));
  }
  template <typename Choice>
  void operator()(const FieldInfo& field, const Choice& value) const {
    entries.push_back(choice_entry(field.path, value, std::string(field.comment)));
  }
};

}  // namespace

std::vector<Entry> scenario_entries(const MicroscopeCampaign& campaign) {
  std::vector<Entry> entries{
      text_entry("campaign.name", campaign.name, "Letters, digits, _, - or ."),
      whole_entry("campaign.seed", static_cast<std::int64_t>(campaign.seed),
                  "All randomness follows from it."),
      whole_entry("campaign.runs", static_cast<std::int64_t>(campaign.num_runs), "May grow later."),
  };
  // Left out where they are the nominal ones, so that the text of a campaign remains the one that
  // it was stored with.
  if (campaign.realisations != 1) {
    entries.push_back(whole_entry("campaign.realisations",
                                  static_cast<std::int64_t>(campaign.realisations),
                                  "Runs that share one instrument and differ in their noise."));
  }
  if (campaign.design.kind != DesignKind::random) {
    entries.push_back(choice_entry("campaign.design", campaign.design.kind,
                                   "\"random\", \"latin_hypercube\" or \"sobol\"."));
    entries.push_back(whole_entry("campaign.points",
                                  static_cast<std::int64_t>(campaign.design.points),
                                  "Runs of a replicate of the design."));
  }
  if (!campaign.environment_file.empty()) {
    entries.push_back(text_entry("environment.file", campaign.environment_file,
                                 "External accelerations, relative to this file."));
  }
  for_each_field(campaign.scenario, FieldWriter{entries});
  return entries;
}

std::vector<Entry> session_entries(const Session& session) {
  return {
      text_entry("name", session.name),
      choice_entry("target", session.target),
      whole_entry("orbits", session.num_orbits),
      real_entry("spin_rate_rad_s", session.spin_rate_rad_s),
      choice_entry("drag_free", session.drag_free),
      lines_entry("fit_lines", session.fit_lines),
      lines_entry("known_lines", session.known_lines),
  };
}

std::vector<Entry> excitation_entries(const Excitation& excitation) {
  std::vector<Entry> entries{choice_entry("kind", excitation.kind),
                             choice_entry("axis", excitation.axis)};
  if (excitation.kind == ExcitationKind::test_mass) {
    entries.push_back(choice_entry("moves", excitation.motion));
  }
  entries.push_back(real_entry(amplitude_key(excitation.kind), excitation.amplitude));
  entries.push_back(real_entry("frequency_hz", excitation.frequency_hz));
  return entries;
}

std::string excitation_text(const Excitation& excitation) {
  return inline_table(excitation_entries(excitation));
}

bool is_left_out(const MicroscopeCampaign& campaign, const DrawGroup& group) {
  if (group.name != eotvos_parameter_group) return false;
  static const DispersionSet nominal = nominal_dispersions();
  return campaign.dispersions[group.first] == nominal[group.first];
}

std::vector<Entry> dispersion_entries(const Dispersion& dispersion) {
  Dispersion fields = dispersion;
  std::vector<Entry> entries{choice_entry("law", dispersion.law)};
  for (const std::string_view key : keys_of(dispersion.law)) {
    entries.push_back(law_entry(key, fields));
  }
  if (dispersion.is_independent) entries.push_back({"independent", "true", "", "true"});
  return entries;
}

std::string dispersion_text(const Dispersion& dispersion) {
  return inline_table(dispersion_entries(dispersion));
}

}  // namespace proofmass::detail

namespace proofmass {
namespace {

void append(std::vector<DefinitionItem>& items, const std::string& prefix,
            std::vector<detail::Entry> entries) {
  for (detail::Entry& entry : entries) {
    items.push_back({.key = prefix + entry.path, .value = std::move(entry.value)});
  }
}

}  // namespace

std::vector<DefinitionItem> definition_items(const MicroscopeCampaign& campaign) {
  std::vector<DefinitionItem> items;
  append(items, "", detail::scenario_entries(campaign));
  const std::vector<Session>& sessions = campaign.scenario.sessions;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    append(items, fmt::format("session[{}].", i), detail::session_entries(sessions[i]));
    for (std::size_t j = 0; j < sessions[i].excitations.size(); ++j) {
      append(items, fmt::format("session[{}].excitations[{}].", i, j),
             detail::excitation_entries(sessions[i].excitations[j]));
    }
  }
  for (const DrawGroup& group : draw_groups()) {
    if (detail::is_left_out(campaign, group)) continue;
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      append(items, fmt::format("dispersion.{}.", drawn_names()[i]),
             detail::dispersion_entries(campaign.dispersions[i]));
    }
  }
  return items;
}

}  // namespace proofmass
