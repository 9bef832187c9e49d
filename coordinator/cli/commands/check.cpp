#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/override_options.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {
namespace {

struct CheckOptions {
  std::filesystem::path file;
  Overrides overrides;
};

/// A file that lacks what its author thinks is in it shows here: what is left out is nominal.
std::string differences_text(const Campaign& campaign) {
  const std::vector<DefinitionDifference> differences =
      campaign.differences_from(*example_campaign());
  if (differences.empty())
    return "Beside the number of runs, nothing differs from what `proofmass init` writes.\n";
  std::string text = "Beside the number of runs, these differ from what `proofmass init` writes:\n";
  for (const auto& [field, own, example] : differences) {
    text += fmt::format("  {} = {} (instead of {})\n", field, own, example);
  }
  return text;
}

int check_campaign_file(const CheckOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  const int num_orbits = campaign->prepare()->num_orbits();
  print_lines(fmt::format("{} is valid\nCampaign  {}, seed {}\nRuns      {} of {} orbits\n\n{}",
                          options.file.string(), campaign->name, campaign->seed, campaign->num_runs,
                          num_orbits, differences_text(*campaign)));
  return exit_done;
}

}  // namespace

void add_check(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CheckOptions>(
      app, chosen, "check", "Check a campaign file and show what it changes", check_campaign_file);
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
}

}  // namespace proofmass::coordinator
