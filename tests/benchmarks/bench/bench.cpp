// The speed of a run of the paper's campaign on one core of this machine, with every instruction
// set that it has, and whether these give the same bits. README.md of the folder above has figures.

#include <fmt/format.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/microscope/environment/environment.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/microscope/simulation/session_signals.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "tests/benchmarks/bench/bench_campaigns.hpp"
#include "tests/benchmarks/bench/bench_parts.hpp"
#include "tests/benchmarks/bench/bench_report.hpp"

namespace proofmass::test {
namespace {

struct BenchOptions {
  bool is_json = false;
  std::uint64_t num_runs = batch_lanes;  ///< Of each instruction set but `scalar`, which takes one.
  bool has_campaigns = false;
};

/// Time of this process.
double processor_s() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <typename Work>
SpentTime spent_on(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  const double processor_start_s = processor_s();
  work();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  return {.wall_s = elapsed.count(), .processor_s = processor_s() - processor_start_s};
}

Machine this_machine() {
  std::ifstream file("/proc/cpuinfo");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  return {.processor = processor_name(text),
          .num_processors = wire::num_processors(),
          .compiler = "GCC " __VERSION__,
          .build_type = PROOFMASS_BUILD_TYPE};
}

std::uint64_t num_steps_of_a_run(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  const KeplerOrbit orbit(scenario.orbit);
  const Environment environment(scenario.environment, campaign.environment_table,
                                scenario.orbit.period_s);
  std::int64_t num_steps = 0;
  for (const Session& session : scenario.sessions) {
    const SessionSignals signals(scenario, session, orbit, environment);
    num_steps += signals.num_settling() + signals.num_record();
  }
  return static_cast<std::uint64_t>(num_steps);
}

std::vector<RunResult> simulate(const RunPlan& plan, std::uint64_t num_runs, InstructionSet set) {
  std::vector<RunResult> results;
  for (std::uint64_t first = 0; first < num_runs; first += batch_lanes) {
    std::vector<RunRequest> requests;
    const std::uint64_t end = std::min<std::uint64_t>(first + batch_lanes, num_runs);
    for (std::uint64_t run = first; run < end; ++run)
      requests.push_back({.run = {run}, .table_values = {}});
    const std::vector<RunResult> of_batch = plan.simulate_batch(requests, set);
    results.insert(results.end(), of_batch.begin(), of_batch.end());
  }
  return results;
}

/// Adds the time of the runs to `spent`.
SetCost measure_set(const MicroscopeCampaign& campaign, const RunPlan& plan, std::uint64_t num_runs,
                    InstructionSet set, std::vector<RunResult>& known, SpentTime& spent) {
  SetCost cost;
  cost.set = set;
  std::vector<RunResult> results;
  const auto time_of = [&](std::uint64_t count) {
    const SpentTime time = spent_on([&] { results = simulate(plan, count, set); });
    cost.has_reference_bits = agree_with_known(results, known) && cost.has_reference_bits;
    spent.wall_s += time.wall_s;
    spent.processor_s += time.processor_s;
    return time.processor_s;
  };
  cost.single_s = time_of(1);
  cost.run_s = num_runs == 1 ? cost.single_s : time_of(num_runs) / static_cast<double>(num_runs);
  cost.noise = measure_noise(campaign, set);
  return cost;
}

StartCost measure_start(const MicroscopeCampaign& campaign) {
  const SpentTime digest = spent_on([] { (void)model().reference_digest(best_instruction_set()); });
  const SpentTime prepare = spent_on([&] { const RunPlan plan(campaign); });
  return {.digest_s = digest.processor_s, .prepare_s = prepare.processor_s};
}

BenchFigures measure(const MicroscopeCampaign& campaign, const BenchOptions& options) {
  const RunPlan plan(campaign);
  BenchFigures figures{.machine = this_machine(),
                       .num_runs = options.num_runs,
                       .num_orbits = plan.num_orbits(),
                       .num_steps = num_steps_of_a_run(campaign),
                       .sets = {},
                       .scalar_step = measure_step_parts(campaign),
                       .start = measure_start(campaign),
                       .spent = {},
                       .campaigns = {}};
  std::vector<RunResult> known;
  for (const InstructionSet set : available_instruction_sets()) {
    // One scalar run is long enough to be timed.
    const std::uint64_t count = set == InstructionSet::scalar ? 1 : options.num_runs;
    figures.sets.push_back(measure_set(campaign, plan, count, set, known, figures.spent));
  }
  const SetCost& scalar = figures.sets.front();
  figures.scalar_step.noise_ns = scalar.noise.step_ns;
  figures.scalar_step.whole_ns = 1e9 * scalar.run_s / static_cast<double>(figures.num_steps);
  if (options.has_campaigns) {
    for (const std::uint64_t num_runs : {std::uint64_t{100}, std::uint64_t{1000}}) {
      figures.campaigns.push_back(measure_campaign(num_runs));
    }
  }
  return figures;
}

}  // namespace
}  // namespace proofmass::test

int main(int argc, char** argv) try {
  using namespace proofmass::test;
  CLI::App app{"Measure the speed of this machine"};
  BenchOptions options;
  app.add_option("--runs", options.num_runs, "Runs of each instruction set")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_flag("--campaigns", options.has_campaigns,
               "Also run campaigns of 100 and 1,000 runs on all\nprocessors");
  app.add_flag("--json", options.is_json, "Print JSON");
  CLI11_PARSE(app, argc, argv);
  const BenchFigures figures = measure(proofmass::MicroscopeCampaign{}, options);
  fmt::print("{}", options.is_json ? bench_json(figures) : bench_table(figures));
  if (all_bits_agree(figures)) return 0;
  fmt::print(stderr, "proofmass_bench: error: instruction sets give different results\n");
  return 1;
} catch (const std::exception& error) {
  fmt::print(stderr, "proofmass_bench: error: {}\n", error.what());
  return 1;
}
