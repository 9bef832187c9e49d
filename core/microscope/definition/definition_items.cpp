#include "core/microscope/definition/definition_items.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <utility>

#include "core/microscope/definition/definition_entries.hpp"

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
  for (std::size_t i = 0; i < num_drawn; ++i) {
    append(items, fmt::format("dispersion.{}.", drawn_names()[i]),
           detail::dispersion_entries(campaign.dispersions[i]));
  }
  return items;
}

}  // namespace proofmass
