#include "core/microscope/definition/definition_entries.hpp"

#include <fmt/format.h>

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass::detail {

namespace {

Entry lines_entry(std::string_view path, const std::vector<LineMultiple>& lines) {
  return list_entry(path, lines, [](const LineMultiple& line) { return text_of(line); });
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
  std::vector<Entry> entries = campaign_entries(campaign);
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

std::vector<Entry> controller_entries(const ControllerConfig& controller) {
  const auto root_text = [](const std::complex<double>& root) {
    return fmt::format("[{}, {}]", real_entry("", root.real()).text,
                       real_entry("", root.imag()).text);
  };
  return {choice_entry("loop", controller.loop),
          choice_entry("axis", controller.axis),
          real_entry("gain", controller.gain),
          list_entry("zeros_rad_s", controller.zeros_rad_s, root_text),
          list_entry("poles_rad_s", controller.poles_rad_s, root_text),
          whole_entry("delay_samples", controller.delay_samples)};
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

std::string dispersion_text(const Dispersion& dispersion) {
  return inline_table(law_entries(dispersion));
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

std::vector<DefinitionItem> MicroscopeCampaign::items() const {
  std::vector<DefinitionItem> items;
  append(items, "", detail::scenario_entries(*this));
  const std::vector<Session>& sessions = scenario.sessions;
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    append(items, fmt::format("session[{}].", i), detail::session_entries(sessions[i]));
    for (std::size_t j = 0; j < sessions[i].excitations.size(); ++j) {
      append(items, fmt::format("session[{}].excitations[{}].", i, j),
             detail::excitation_entries(sessions[i].excitations[j]));
    }
  }
  const std::vector<ControllerConfig>& controllers = scenario.controllers;
  for (std::size_t i = 0; i < controllers.size(); ++i) {
    append(items, fmt::format("controller[{}].", i), detail::controller_entries(controllers[i]));
  }
  for (const DrawGroup& group : draw_groups()) {
    if (detail::is_left_out(*this, group)) continue;
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      append(items, fmt::format("dispersion.{}.", drawn_names()[i]),
             detail::law_entries(dispersions[i]));
    }
  }
  return items;
}

}  // namespace proofmass
