#include "coordinator/campaign_file/definition_entries.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "coordinator/campaign_file/definition_text.hpp"
#include "coordinator/campaign_file/dispersion_keys.hpp"
#include "core/session/session_names.hpp"

namespace proofmass::coordinator::detail {
namespace {

template <typename Choice>
std::string choice_text(Choice choice) {
  return quoted_text(names_of(choice)[static_cast<std::size_t>(choice) - 1]);
}

std::string lines_text(const std::vector<LineMultiple>& lines) {
  std::string text = "[";
  for (const LineMultiple& line : lines) {
    if (text.size() > 1) text += ", ";
    text += text_of(line);
  }
  return text + "]";
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
    add(field, number_text(value), comment_of(field));
  }
  void operator()(const FieldInfo& field, const std::int64_t& value) const {
    add(field, fmt::format("{}", value), comment_of(field));
  }
  template <typename Choice>
  void operator()(const FieldInfo& field, const Choice& value) const {
    add(field, choice_text(value), std::string(field.comment));
  }

 private:
  void add(const FieldInfo& field, std::string text, std::string comment) const {
    entries.push_back({std::string(field.path), std::move(text), std::move(comment)});
  }
};

}  // namespace

std::vector<Entry> scenario_entries(const Campaign& campaign) {
  std::vector<Entry> entries{
      {"campaign.name", quoted_text(campaign.name), "Letters, digits, _, - or ."},
      {"campaign.seed", fmt::format("{}", campaign.seed), "All randomness follows from it."},
      {"campaign.runs", fmt::format("{}", campaign.num_runs), "May grow later."},
  };
  if (!campaign.environment_file.empty()) {
    entries.push_back({"environment.file", quoted_text(campaign.environment_file),
                       "External accelerations, relative to this file."});
  }
  for_each_field(campaign.scenario, FieldWriter{entries});
  return entries;
}

std::vector<Entry> session_entries(const Session& session) {
  return {
      {"name", quoted_text(session.name), ""},
      {"target", choice_text(session.target), ""},
      {"orbits", fmt::format("{}", session.num_orbits), ""},
      {"spin_rate_rad_s", number_text(session.spin_rate_rad_s), ""},
      {"drag_free", choice_text(session.drag_free), ""},
      {"fit_lines", lines_text(session.fit_lines), ""},
      {"known_lines", lines_text(session.known_lines), ""},
  };
}

std::string excitation_text(const Excitation& excitation) {
  std::vector<Entry> entries{{"kind", choice_text(excitation.kind), ""},
                             {"axis", choice_text(excitation.axis), ""}};
  if (excitation.kind == ExcitationKind::test_mass) {
    entries.push_back({"moves", choice_text(excitation.motion), ""});
  }
  entries.push_back(
      {std::string(amplitude_key(excitation.kind)), number_text(excitation.amplitude), ""});
  entries.push_back({"frequency_hz", number_text(excitation.frequency_hz), ""});
  return inline_table(entries);
}

std::vector<Entry> dispersion_entries(const Dispersion& dispersion) {
  Dispersion fields = dispersion;
  std::vector<Entry> entries{{"law", choice_text(dispersion.law), ""}};
  for (const std::string_view key : keys_of(dispersion.law)) {
    const double* const number = number_at(fields, key);
    entries.push_back(
        {std::string(key),
         number != nullptr ? number_text(*number) : quoted_text(*text_at(fields, key)), ""});
  }
  return entries;
}

std::string dispersion_text(const Dispersion& dispersion) {
  return inline_table(dispersion_entries(dispersion));
}

}  // namespace proofmass::coordinator::detail
