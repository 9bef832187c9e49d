#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/override_options.hpp"
#include "coordinator/cli/progress_display.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/model.hpp"
#include "core/math/instruction_set.hpp"

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

/// Processor time after which the time of a batch is extrapolated.
constexpr double measured_s_max = 0.5;

/// Thrown out of a simulation that has been measured for long enough.
struct Measured {};

/// Processor time of a batch of the campaign's runs on this machine, extrapolated from the orbits
/// that its first half second takes. The orbits of all sessions cost about the same.
double measure_batch_s(const Campaign& campaign, const Plan& plan) {
  const InstructionSet set = best_instruction_set();
  // Scalar code simulates the runs of a batch one after the other.
  const std::size_t num_at_once = set == InstructionSet::scalar ? 1 : model().batch_size();
  std::vector<RunRequest> requests;
  for (std::uint64_t run = 0; run < std::min<std::uint64_t>(num_at_once, campaign.num_runs);
       ++run) {
    requests.push_back({.run = {run}, .table_values = campaign.table_values({run})});
  }
  const std::clock_t start = std::clock();
  const auto elapsed_s = [start] {
    return static_cast<double>(std::clock() - start) / static_cast<double>(CLOCKS_PER_SEC);
  };
  int num_orbits = plan.num_orbits();
  try {
    (void)plan.simulate_batch(requests, set, [&](int num_orbits_now) {
      if (num_orbits_now == 0 || elapsed_s() < measured_s_max) return;
      num_orbits = num_orbits_now;
      throw Measured{};
    });
  } catch (const Measured&) {
    // The orbits so far are enough.
  }
  const double all_orbits = static_cast<double>(plan.num_orbits()) / num_orbits;
  const std::size_t num_rounds = model().batch_size() / num_at_once;
  return elapsed_s() * all_orbits * static_cast<double>(num_rounds);
}

/// Size of a campaign database. Measured with the paper's campaign: an empty database has 170 kB; a
/// run adds 8 bytes for each of its numbers and 90 bytes for how and by whom it was computed.
double database_mb(std::uint64_t num_runs) {
  constexpr double empty_size = 170e3, number_size = 8.0, further_size = 90.0;
  const ResultSchema& schema = model().results();
  // Truth and estimate of each quantity.
  const auto num_numbers = static_cast<double>(2 * schema.quantities.size() + schema.health.size());
  const double run_size = number_size * num_numbers + further_size;
  return (empty_size + run_size * static_cast<double>(num_runs)) / 1e6;
}

/// `run` gives each core one batch of runs at a time; an incomplete batch costs as much as a whole.
std::string cost_text(const Campaign& campaign, const Plan& plan) {
  const double batch_s = measure_batch_s(campaign, plan);
  const std::uint64_t num_cores = std::max(1U, std::thread::hardware_concurrency());
  const auto rounds = [&](std::uint64_t num_at_a_time) {
    return static_cast<double>((campaign.num_runs + num_at_a_time - 1) / num_at_a_time);
  };
  return fmt::format(
      "Time      about {} of one core; about {} with `proofmass run` on the {} cores here\n"
      "Disk      about {:.1f} MB\n",
      duration_text(rounds(model().batch_size()) * batch_s),
      duration_text(rounds(model().batch_size() * num_cores) * batch_s), num_cores,
      database_mb(campaign.num_runs));
}

int check_campaign_file(const CheckOptions& options) {
  const std::unique_ptr<const Campaign> campaign = read_campaign(options.file, options.overrides);
  const std::unique_ptr<const Plan> plan = campaign->prepare();
  print_lines(fmt::format("{} is valid\nCampaign  {}, seed {}\nRuns      {} of {} orbits\n{}\n{}",
                          options.file.string(), campaign->name, campaign->seed, campaign->num_runs,
                          plan->num_orbits(), cost_text(*campaign, *plan),
                          differences_text(*campaign)));
  return exit_done;
}

}  // namespace

void add_check(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<CheckOptions>(
      app, chosen, "check", "Check a campaign file; show its cost and changes",
      check_campaign_file);
  add_campaign_file(command, options.file);
  add_override_options(command, options.overrides);
}

}  // namespace proofmass::coordinator
