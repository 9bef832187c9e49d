#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/cost_estimate.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator {
namespace {

struct CheckOptions {
  std::filesystem::path file;
  Overrides overrides;
  OutputFormat format = OutputFormat::text;
};

/// A file that lacks what its author thinks is in it shows here: what is left out is nominal.
std::string differences_text(const std::vector<DefinitionDifference>& differences) {
  if (differences.empty())
    return "Beside the number of runs, nothing differs from what `proofmass init` writes.\n";
  std::string text = "Beside the number of runs, these differ from what `proofmass init` writes:\n";
  for (const auto& [field, own, example] : differences) {
    text += fmt::format("  {} = {} (instead of {})\n", field, own, example);
  }
  return text;
}

/// What can be said of the first runs without computing many.
struct Outlook {
  std::uint64_t num_drawn = 0;  ///< Instruments, one for all realisations of its noise.
  std::uint64_t num_draws = 0;  ///< Of these.
  std::uint64_t num_without_draw = 0;
  double batch_s = 0.0;
  std::size_t num_simulated = 0;                       ///< Runs; 0 if they take too long.
  MissingEstimates missing;                            ///< Of these.
  std::vector<DefinitionDifference> differences = {};  ///< From the example.
};

Outlook outlook_on(const Campaign& campaign, const Plan& plan) {
  constexpr std::uint64_t instruments_max = 1000,
                          draws_max = 20'000;  // Some hundredths of a second.
  const FirstBatch batch = try_first_batch(campaign, plan);
  Outlook outlook{.batch_s = batch.time_s, .num_simulated = batch.results.size(), .missing = {}};
  for (const RunResult& result : batch.results) outlook.missing.add(result);
  // The program that accepts the example may be the one that computes a run again.
  outlook.differences = campaign.differences_from(*example_campaign(campaign.model()));
  const bool is_program = !campaign.model().description().empty();
  if (is_program) wire::require_repeatable(campaign, batch.results.back());
  const std::uint64_t each = campaign.num_realisations();
  const std::uint64_t num_instruments = (campaign.num_runs + each - 1) / each;
  for (; outlook.num_drawn < std::min(num_instruments, instruments_max) &&
         outlook.num_draws < draws_max;
       ++outlook.num_drawn) {
    const std::uint64_t run = outlook.num_drawn * each;
    const RunDraw draw = campaign.draw(RunIndex{run});
    outlook.num_draws += draw.num_draws;
    if (draw.values.empty()) ++outlook.num_without_draw;
  }
  return outlook;
}

/// Empty for a campaign that `plan` knows no more of.
std::string advice_to_plan(const CheckOptions& options, const Campaign& campaign) {
  try {
    if (campaign.model().study(campaign) == nullptr) return "";
  } catch (const Error&) {
    return "";
  }
  // Without them it would tell of another campaign.
  std::string command = "proofmass plan " + wire::shell_word(options.file.string());
  for (const std::string& assignment : options.overrides.assignments) {
    command += " --set " + wire::shell_word(assignment);
  }
  if (options.overrides.seed) command += fmt::format(" --seed {}", *options.overrides.seed);
  return fmt::format("see `{}`", command);
}

std::string outlook_text(const CheckOptions& options, const Campaign& campaign,
                         const Outlook& outlook) {
  std::string text =
      fmt::format("Draws     {} of {} accepted, for the first {} {}\n",
                  outlook.num_drawn - outlook.num_without_draw, outlook.num_draws,
                  outlook.num_drawn, campaign.num_realisations() > 1 ? "instruments" : "runs");
  if (outlook.num_without_draw > 0) {
    text += fmt::format(
        "Warning   {} of these find none in {} draws and end without an estimate:\n"
        "          widen the bounds or narrow the laws\n",
        outlook.num_without_draw, campaign.results().num_draws_max);
  }
  const std::uint64_t each = campaign.num_realisations(), rest = campaign.num_runs % each;
  if (rest > 0) {
    text += fmt::format(
        "Warning   the last draw has {} of its {} runs, and reports leave it out; use --runs {}\n",
        rest, each, campaign.num_runs - rest + each);
  }
  if (outlook.num_simulated == 0) {
    const std::string advice = advice_to_plan(options, campaign);
    return text + "Losses    not tried, as runs are long" + (advice.empty() ? "" : "; " + advice);
  }
  const std::string reasons = reasons_text(outlook.missing);
  text +=
      fmt::format("Losses    {} of the first {} runs{}{}", outlook.missing.total(),
                  outlook.num_simulated, reasons.empty() ? "" : ", without an estimate: ", reasons);
  if (outlook.missing.num_lost == 0) return text;
  const std::string advice = advice_to_plan(options, campaign);
  if (!advice.empty()) text += ";\n          for the cause " + advice;
  return text;
}

Json check_json(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                const Outlook& outlook, const CostEstimate& cost) {
  const auto of_difference = [](const DefinitionDifference& of) -> Json {
    return {{"field", of.field}, {"value", of.first}, {"example", of.second}};
  };
  return {{"file", options.file.string()},
          {"campaign", campaign.name},
          {"seed", std::to_string(campaign.seed)},
          {"num_runs", campaign.num_runs},
          {"note", campaign.note()},
          {"num_steps", plan.num_steps()},
          {"step_name", campaign.model().step_name()},
          {"one_core_s", cost.one_core_s},
          {"all_cores_s", cost.all_cores_s},
          {"num_cores", wire::num_processors()},
          {"disk_bytes", cost.disk_mb * 1e6},
          {"num_drawn", outlook.num_drawn},
          {"num_draws", outlook.num_draws},
          {"num_without_draw", outlook.num_without_draw},
          {"num_simulated", outlook.num_simulated},
          {"num_without_estimate", outlook.missing.total()},
          {"differences", array_of(outlook.differences, of_difference)}};
}

std::string check_text(const CheckOptions& options, const Campaign& campaign, const Plan& plan,
                       const Outlook& outlook, const CostEstimate& cost) {
  // The steps of a model program are its own.
  const std::string steps = plan.num_steps() == 1 ? std::string()
                                                  : fmt::format(" of {} {}", plan.num_steps(),
                                                                campaign.model().step_name());
  return fmt::format("{} is valid\nCampaign  {}, seed {}\nRuns      {}{}\n{}{}\n{}\n{}",
                     options.file.string(), campaign.name, campaign.seed, campaign.num_runs, steps,
                     note_text(campaign.note()), outlook_text(options, campaign, outlook),
                     cost_text(cost), differences_text(outlook.differences));
}

int check_campaign_file(const CheckOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  const std::unique_ptr<const Plan> plan = campaign->prepare();
  const Outlook outlook = outlook_on(*campaign, *plan);
  const CostEstimate cost = estimated_cost(*campaign, campaign->num_runs, outlook.batch_s);
  if (options.format == OutputFormat::json) {
    print_json(check_json(options, *campaign, *plan, outlook, cost));
  } else {
    print_lines(fitted(check_text(options, *campaign, *plan, outlook, cost)));
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
