#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/cost_estimate.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

struct CheckOptions {
  std::filesystem::path file;
  Overrides overrides;
  OutputFormat format = OutputFormat::text;
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

using CheckJson = nlohmann::ordered_json;

CheckJson check_json(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                     const CostEstimate& cost) {
  CheckJson json{{"file", options.file.string()},         {"campaign", campaign.name},
                 {"seed", std::to_string(campaign.seed)}, {"num_runs", campaign.num_runs},
                 {"num_steps", plan.num_steps()},         {"step_name", model().step_name()},
                 {"one_core_s", cost.one_core_s},         {"all_cores_s", cost.all_cores_s},
                 {"num_cores", wire::num_processors()},   {"disk_bytes", cost.disk_mb * 1e6},
                 {"differences", CheckJson::array()}};
  for (const auto& [field, own, example] : campaign.differences_from(*example_campaign())) {
    json["differences"].push_back({{"field", field}, {"value", own}, {"example", example}});
  }
  return json;
}

std::string check_text(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                       const CostEstimate& cost) {
  return fmt::format("{} is valid\nCampaign  {}, seed {}\nRuns      {} of {} {}\n{}\n{}",
                     options.file.string(), campaign.name, campaign.seed, campaign.num_runs,
                     plan.num_steps(), model().step_name(), cost_text(cost),
                     differences_text(campaign));
}

int check_campaign_file(const CheckOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  const std::unique_ptr<const Plan> plan = campaign->prepare();
  const CostEstimate cost =
      estimated_cost(campaign->results(), campaign->num_runs, measure_batch_s(*campaign, *plan));
  if (options.format == OutputFormat::json) {
    print_json(check_json(options, *campaign, *plan, cost));
  } else {
    print_lines(check_text(options, *campaign, *plan, cost));
  }
  return exit_done;
}

}  // namespace

void add_check(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CheckOptions>(
      app, chosen, "check", "Check a campaign file; show its cost and changes",
      check_campaign_file);
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
