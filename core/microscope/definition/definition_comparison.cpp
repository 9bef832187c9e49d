#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/definition/definition_entries.hpp"

namespace proofmass {
namespace {

using detail::Entry;

/// Collects the differences between two campaigns, part by part.
class Comparison {
 public:
  Comparison(const MicroscopeCampaign& first, const MicroscopeCampaign& second)
      : first_(first), second_(second) {}

  std::vector<DefinitionDifference> run() {
    compare_sampling();
    compare_entries("", fields_of(first_, second_), fields_of(second_, first_));
    compare_sessions();
    compare_controllers();
    compare_environment();
    compare_dispersions();
    return std::move(differences_);
  }

 private:
  void differ(std::string_view path, std::string_view first, std::string_view second) {
    differences_.push_back(
        {.field = std::string(path), .first = std::string(first), .second = std::string(second)});
  }

  void compare_sampling() {
    const auto compare = [this](std::string_view path, auto first, auto second) {
      if (first != second) differ(path, fmt::format("{}", first), fmt::format("{}", second));
    };
    compare("campaign.realisations", first_.realisations, second_.realisations);
    compare("campaign.design", name_of(first_.design.kind), name_of(second_.design.kind));
    const auto is_random = [](const SamplingDesign& of) { return of.kind == DesignKind::random; };
    if (is_random(first_.design) || is_random(second_.design)) return;  // It has no points.
    compare("campaign.points", first_.design.points, second_.design.points);
  }

  // More runs extend a campaign; the values of data files are compared, not their names.
  // A campaign without realism or tests has their fields as they are by default.
  static std::vector<Entry> fields_of(MicroscopeCampaign campaign,
                                      const MicroscopeCampaign& other) {
    Scenario& scenario = campaign.scenario;
    if (other.scenario.realism && !scenario.realism) scenario.realism.emplace();
    if (other.scenario.has_tests() && !scenario.has_tests()) {
      scenario.sessions.emplace_back().target = SessionTarget::ep_test;
    }
    std::vector<Entry> entries = detail::scenario_entries(campaign);
    std::erase_if(entries, [](const Entry& entry) {
      static constexpr std::array<std::string_view, 5> left_out{
          "campaign.runs", "campaign.realisations", "campaign.design", "campaign.points",
          "environment.file"};
      return std::ranges::find(left_out, entry.path) != left_out.end();
    });
    for (Entry& entry : entries) {
      constexpr std::string_view table = "campaign.";
      if (entry.path.starts_with(table)) entry.path.erase(0, table.size());
    }
    return entries;
  }

  /// Sessions that test have other fields than those that do not.
  void compare_entries(const std::string& prefix, const std::vector<Entry>& first,
                       const std::vector<Entry>& second) {
    for (const Entry& entry : first) {
      const auto same = std::ranges::find(second, entry.path, &Entry::path);
      if (same == second.end() || same->text == entry.text) continue;
      differ(prefix + entry.path, entry.text, same->text);
    }
  }

  static std::vector<Entry> entries_of(const Session& session) {
    std::vector<Entry> entries = detail::session_entries(session);
    entries.push_back(
        detail::list_entry("excitations", session.excitations, detail::excitation_text));
    return entries;
  }

  static std::string names_text(const std::vector<Session>& sessions) {
    std::string text = fmt::format("{} (", sessions.size());
    for (const Session& session : sessions) text += session.name + " ";
    text.back() = ')';
    return text;
  }

  void compare_sessions() {
    const std::vector<Session>& first = first_.scenario.sessions;
    const std::vector<Session>& second = second_.scenario.sessions;
    if (first.size() != second.size()) {
      differ("session", names_text(first), names_text(second));
      return;
    }
    for (std::size_t i = 0; i < first.size(); ++i) {
      const bool is_same = first[i].name == second[i].name;
      const std::string prefix =
          is_same ? fmt::format("session.{}.", first[i].name) : fmt::format("session[{}].", i);
      compare_entries(prefix, entries_of(first[i]), entries_of(second[i]));
    }
  }

  void compare_controllers() {
    const std::vector<ControllerConfig>& first = first_.scenario.controllers;
    const std::vector<ControllerConfig>& second = second_.scenario.controllers;
    if (first.size() != second.size()) {
      differ("controller", fmt::format("{}", first.size()), fmt::format("{}", second.size()));
      return;
    }
    for (std::size_t i = 0; i < first.size(); ++i) {
      compare_entries(fmt::format("controller[{}].", i), detail::controller_entries(first[i]),
                      detail::controller_entries(second[i]));
    }
  }

  void compare_environment() {
    const EnvironmentTable& first = first_.environment_table;
    const EnvironmentTable& second = second_.environment_table;
    if (first.size() != second.size()) {
      differ("environment.file", fmt::format("{} rows", first.size()),
             fmt::format("{} rows", second.size()));
      return;
    }
    const auto position = std::ranges::mismatch(first, second).in1;
    if (position == first.end()) return;
    differ("environment.file", fmt::format("other values in row {}", position - first.begin() + 1),
           fmt::format("those of {}", second_.environment_file));
  }

  void compare_dispersions() {
    for (std::size_t i = 0; i < num_drawn; ++i) {
      const Dispersion& first = first_.dispersions[i];
      const Dispersion& second = second_.dispersions[i];
      if (first.law == Law::table && second.law == Law::table &&
          first.is_independent == second.is_independent) {
        if (auto difference = table_difference({first_, law_set(first_.dispersions)},
                                               {second_, law_set(second_.dispersions)}, i)) {
          differences_.push_back(*std::move(difference));
        }
      } else if (detail::dispersion_text(first) != detail::dispersion_text(second)) {
        differ("dispersion." + drawn_names()[i], detail::dispersion_text(first),
               detail::dispersion_text(second));
      }
    }
  }

  const MicroscopeCampaign& first_;
  const MicroscopeCampaign& second_;
  std::vector<DefinitionDifference> differences_;
};

}  // namespace

std::vector<DefinitionDifference> MicroscopeCampaign::differences_from(
    const Campaign& other) const {
  const auto* const second = dynamic_cast<const MicroscopeCampaign*>(&other);
  if (second == nullptr) return {};
  return Comparison(*this, *second).run();
}

}  // namespace proofmass
