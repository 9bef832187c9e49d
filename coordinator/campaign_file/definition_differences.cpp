#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <string>
#include <utility>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/campaign_file/definition_entries.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Entry;

/// Collects the differences between two campaigns, part by part.
class Comparison {
 public:
  Comparison(const Campaign& stored, const Campaign& wanted) : stored_(stored), wanted_(wanted) {}

  std::vector<std::string> run() {
    compare_entries("", fields_of(stored_), fields_of(wanted_));
    compare_sessions();
    compare_environment();
    compare_dispersions();
    return std::move(differences_);
  }

 private:
  void differ(std::string_view path, std::string_view stored, std::string_view wanted) {
    differences_.push_back(
        fmt::format("{}: {} in the database, {} asked for", path, stored, wanted));
  }

  // More runs extend a campaign; the values of data files are compared, not their names.
  static std::vector<Entry> fields_of(const Campaign& campaign) {
    std::vector<Entry> entries = detail::scenario_entries(campaign);
    std::erase_if(entries, [](const Entry& entry) {
      return entry.path == "campaign.runs" || entry.path == "environment.file";
    });
    for (Entry& entry : entries) {
      constexpr std::string_view table = "campaign.";
      if (entry.path.starts_with(table)) entry.path.erase(0, table.size());
    }
    return entries;
  }

  void compare_entries(const std::string& prefix, const std::vector<Entry>& stored,
                       const std::vector<Entry>& wanted) {
    for (std::size_t i = 0; i < stored.size(); ++i) {
      if (stored[i].text != wanted[i].text) {
        differ(prefix + stored[i].path, stored[i].text, wanted[i].text);
      }
    }
  }

  static std::string excitations_text(const Session& session) {
    std::string text;
    for (const Excitation& excitation : session.excitations) {
      text += (text.empty() ? "" : ", ") + detail::excitation_text(excitation);
    }
    return "[" + text + "]";
  }

  void compare_sessions() {
    const std::vector<Session>& stored = stored_.scenario.sessions;
    const std::vector<Session>& wanted = wanted_.scenario.sessions;
    if (stored.size() != wanted.size()) {
      differ("session", fmt::format("{}", stored.size()), fmt::format("{}", wanted.size()));
      return;
    }
    for (std::size_t i = 0; i < stored.size(); ++i) {
      const std::string prefix = fmt::format("session[{}].", i);
      compare_entries(prefix, detail::session_entries(stored[i]),
                      detail::session_entries(wanted[i]));
      if (stored[i].excitations != wanted[i].excitations) {
        differ(prefix + "excitations", excitations_text(stored[i]), excitations_text(wanted[i]));
      }
    }
  }

  void compare_environment() {
    const EnvironmentTable& stored = stored_.environment_table;
    const EnvironmentTable& wanted = wanted_.environment_table;
    if (stored.size() != wanted.size()) {
      differ("environment.file", fmt::format("{} rows", stored.size()),
             fmt::format("{} rows", wanted.size()));
      return;
    }
    const auto [first, second] = std::ranges::mismatch(stored, wanted);
    if (first == stored.end()) return;
    differ("environment.file", fmt::format("other values in row {}", first - stored.begin() + 1),
           fmt::format("those of {}", wanted_.environment_file));
  }

  void compare_dispersions() {
    for (std::size_t i = 0; i < num_drawn; ++i) {
      const Dispersion& stored = stored_.dispersions[i];
      const Dispersion& wanted = wanted_.dispersions[i];
      if (stored.law == Law::table && wanted.law == Law::table) {
        compare_column(i);
      } else if (detail::dispersion_text(stored) != detail::dispersion_text(wanted)) {
        differ("dispersion." + drawn_names()[i], detail::dispersion_text(stored),
               detail::dispersion_text(wanted));
      }
    }
  }

  // Values of the runs that both campaigns have.
  void compare_column(std::size_t element) {
    const std::vector<double>& stored = column_of(stored_, element);
    const std::vector<double>& wanted = column_of(wanted_, element);
    const std::uint64_t num_shared =
        std::min({std::min(stored_.num_runs, wanted_.num_runs), std::uint64_t{stored.size()},
                  std::uint64_t{wanted.size()}});
    for (std::size_t run = 0; run < num_shared; ++run) {
      if (std::bit_cast<std::uint64_t>(stored[run]) == std::bit_cast<std::uint64_t>(wanted[run])) {
        continue;
      }
      differ(fmt::format("dispersion.{} of run {}", drawn_names()[element], run),
             fmt::format("{}", stored[run]), fmt::format("{}", wanted[run]));
      return;
    }
  }

  static const std::vector<double>& column_of(const Campaign& campaign, std::size_t element) {
    const std::vector<std::size_t> elements = table_elements(campaign.dispersions);
    const auto position = std::ranges::find(elements, element) - elements.begin();
    return campaign.table_columns[static_cast<std::size_t>(position)];
  }

  const Campaign& stored_;
  const Campaign& wanted_;
  std::vector<std::string> differences_;
};

}  // namespace

std::vector<std::string> definition_differences(const Campaign& stored, const Campaign& wanted) {
  return Comparison(stored, wanted).run();
}

}  // namespace proofmass::coordinator
