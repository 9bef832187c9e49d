#include "coordinator/archive/series_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

/// @throws InvalidArgument for a name of `chosen` that is not one of `known`.
void require_known(std::string_view field, std::span<const std::string> chosen,
                   const std::vector<std::string>& known) {
  for (const std::string& name : chosen) {
    if (std::ranges::find(known, name) != known.end()) continue;
    throw InvalidArgument(
        fmt::format("{} = {} (must be one of {})", field, name, fmt::join(known, " ")));
  }
}

template <typename Named>
std::vector<std::string> names_of_all(const std::vector<Named>& all) {
  std::vector<std::string> names;
  for (const Named& one : all) names.push_back(one.name);
  return names;
}

bool is_chosen(std::span<const std::string> chosen, const std::string& name) {
  return chosen.empty() || std::ranges::find(chosen, name) != chosen.end();
}

}  // namespace

SignalSelection::SignalSelection(const Recording& recording, std::span<const std::string> sessions,
                                 std::span<const std::string> groups)
    : recording_(&recording) {
  require_known("session", sessions, names_of_all(recording.sessions));
  require_known("group", groups, names_of_all(recording.groups));
  for (const RecordedSession& session : recording.sessions) {
    has_session_.push_back(is_chosen(sessions, session.name));
  }
  std::size_t first_value = 0;
  for (const SignalGroup& group : recording.groups) {
    if (is_chosen(groups, group.name)) groups_.push_back({&group, first_value});
    first_value += group.signals.size();
  }
}

}  // namespace proofmass::coordinator
