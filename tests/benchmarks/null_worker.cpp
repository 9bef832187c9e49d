// A worker whose runs cost nothing: it measures and tests all that is around the runs. Its results
// are made up, the same for a run wherever it is computed.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "core/microscope/simulation/run.hpp"
#include "tests/benchmarks/null_result.hpp"
#include "tests/support/prepared_campaign.hpp"
#include "worker/program.hpp"

namespace {

using namespace proofmass;

constexpr int num_steps = 10;

struct NullOptions {
  std::optional<std::uint64_t> poison;  ///< This run ends the process by SIGSEGV.
  std::optional<std::uint64_t> hang;    ///< This one never ends and finishes no step.
  double run_time_s = 0.0;              ///< What a batch takes.
};

bool has(std::span<const RunRequest> requests, std::optional<std::uint64_t> run) {
  return std::ranges::any_of(requests,
                             [&](const RunRequest& request) { return request.run.value == run; });
}

/// Ends the process by the signal, also where a sanitizer would catch it.
void crash() {
  (void)std::signal(SIGSEGV, SIG_DFL);
  (void)std::raise(SIGSEGV);
}

/// Takes the time of a batch, and looks now and then whether it is still wanted.
void pass_time(double run_time_s, const std::function<void(int)>& progress) {
  for (int step = 1; step <= num_steps; ++step) {
    if (run_time_s > 0.0) {
      std::this_thread::sleep_for(std::chrono::duration<double>(run_time_s / num_steps));
    }
    progress(step);
  }
}

test::PreparedCampaign prepare(const Campaign& definition, const NullOptions& options) {
  std::shared_ptr<Campaign> campaign = definition.clone();
  campaign->num_runs = num_runs_max;  // It may be extended.
  return {.simulate =
              [campaign, &options](std::span<const RunRequest> requests,
                                   const std::function<void(int)>& progress) {
                if (has(requests, options.poison)) crash();
                while (has(requests, options.hang)) {
                  std::this_thread::sleep_for(std::chrono::hours(1));
                }
                pass_time(options.run_time_s, progress);
                std::vector<RunResult> results;
                for (const RunRequest& request : requests) {
                  results.push_back(test::null_result(*campaign, request.run));
                }
                return results;
              },
          .num_steps = num_steps};
}

}  // namespace

int main(int argc, char** argv) {
  constexpr double run_time_s_max = 3600.0;
  NullOptions options;
  const auto add_options = [&](CLI::App& app) {
    app.add_option("--poison", options.poison, "Run that ends the process by SIGSEGV");
    app.add_option("--hang", options.hang, "Run that never ends");
    app.add_option("--run-time", options.run_time_s, "Seconds that a batch of runs takes")
        ->check(CLI::Range(0.0, run_time_s_max));
  };
  return worker::run_worker(
      argc, argv,
      {.name = "proofmass-null-worker",
       .prepare = [&](const Campaign& campaign) { return prepare(campaign, options); },
       .add_options = add_options});
}
