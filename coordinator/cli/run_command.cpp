#include "coordinator/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include "coordinator/cli/campaign_start.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/local_workers.hpp"
#include "coordinator/cli/progress_display.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/net/private_endpoint.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/report/report.hpp"
#include "core/simulation/reference_digest.hpp"
#include "core/simulation/run.hpp"

namespace proofmass::coordinator {
namespace {

std::filesystem::path database_of(const RunOptions& options) {
  return options.database.value_or(options.campaign_file.stem().string() + ".db");
}

std::uint64_t count(std::span<const RunRange> ranges) {
  std::uint64_t num_runs = 0;
  for (const RunRange& range : ranges) num_runs += range.count;
  return num_runs;
}

std::uint64_t num_missing(const Store& store) {
  return store.num_runs() - count(store.finished_runs());
}

/// No more than there are batches: runs of one batch take no longer than one of them.
std::uint64_t num_workers(const RunOptions& options, std::uint64_t num_runs_missing) {
  const unsigned num_processors = std::max(1U, std::thread::hardware_concurrency());
  const std::uint64_t num_batches = (num_runs_missing + batch_lanes - 1) / batch_lanes;
  return std::min<std::uint64_t>(options.num_workers.value_or(num_processors), num_batches);
}

/// The service of one campaign for the workers of this process.
ServiceConfig service_config(const PrivateEndpoint& endpoint, std::uint64_t num_workers) {
  ServiceConfig config;
  config.workers_endpoint = endpoint.address();
  config.end = ServiceEnd::when_done;
  config.given_up = GivenUpRuns::retry;
  config.version = PROOFMASS_VERSION;
  config.dispatch.reference_digest = reference_digest(best_instruction_set());
  config.dispatch.reattach_wait = Duration::zero();  // Workers of the last time ended with it.
  // All workers may die at once, and runs must be found guilty before the machine is.
  config.dispatch.crashes_per_host_max =
      config.dispatch.crashes_per_run_max * static_cast<std::uint32_t>(num_workers + 1);
  return config;
}

/// What nobody needs to see while all goes well goes into the database only.
Log log_to(ProgressDisplay& display) {
  return [&display](const Event& event) {
    if (event.severity != Severity::error) return;
    display.note(fmt::format("proofmass: error: {} {}", event.kind, event.text));
  };
}

ServedCampaign served(const Campaign& campaign, Store store, const std::filesystem::path& database,
                      const RunOptions& options) {
  const Entry control = CampaignControl{.phase = wire::CampaignPhase::active,
                                        .priority = store.control().priority,
                                        .audit_fraction = options.audit_fraction};
  (void)store.write({&control, 1});
  // Shared with the dispatch and with messages under way.
  return {.file = database,
          .store = std::move(store),
          .definition = std::make_shared<const Campaign>(campaign)};
}

/// What came of a campaign.
struct Outcome {
  Store store;
  bool is_done = false;  ///< Every run is stored or given up.
};

/// Computes the missing runs.
Outcome compute(const Campaign& campaign, Store store, const std::filesystem::path& database,
                const RunOptions& options) {
  const std::uint64_t num_runs_missing = num_missing(store);
  if (num_runs_missing == 0) return {.store = std::move(store), .is_done = true};
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  ProgressDisplay display(options.is_quiet ? DisplayMode::quiet : display_mode_for(stderr), stderr);
  const PrivateEndpoint endpoint;
  const std::uint64_t num_local = num_workers(options, num_runs_missing);
  std::vector<ServedCampaign> campaigns;
  campaigns.push_back(served(campaign, std::move(store), database, options));
  Service service(std::move(campaigns), service_config(endpoint, num_local), log_to(display));
  LocalWorkers workers(service, display);
  workers.start(num_local);
  service.run(stop, [&] {
    if (stop == StopRequest::none && !service.is_done()) workers.replace_dead();
    display.update(service.campaigns().front());
  });
  display.update(service.campaigns().front());
  const bool is_done = service.is_done();
  return {.store = std::move(service.close().front().store), .is_done = is_done};
}

int say_interrupted(const Store& store, const std::filesystem::path& database) {
  const std::uint64_t num_runs = store.num_runs();
  fmt::print(stderr,
             "proofmass: interrupted; {} of {} runs are in {}\n"
             "proofmass: the same command computes the others\n",
             num_runs - num_missing(store), num_runs, database.string());
  return exit_interrupted;
}

int say_given_up(std::span<const RunRange> given_up, std::uint64_t num_runs) {
  const RunSet runs(given_up);
  fmt::print(stderr,
             "proofmass: error: {} of {} runs given up, having crashed their workers: {}\n"
             "proofmass: the same command tries them again\n",
             runs.size(), num_runs, to_text(runs));
  return exit_cannot_be_done;
}

}  // namespace

int run_campaign(const RunOptions& options) {
  const Campaign campaign = read_campaign(options.campaign_file, options.overrides);
  const std::filesystem::path database = database_of(options);
  Outcome outcome = compute(campaign, open_or_create(campaign, database), database, options);
  update_statistics(outcome.store, campaign.scenario);
  if (!outcome.is_done) return say_interrupted(outcome.store, database);
  fmt::print("{}", report_text(outcome.store, campaign.scenario));
  const std::vector<RunRange> given_up = outcome.store.given_up_runs();
  return given_up.empty() ? exit_done : say_given_up(given_up, campaign.num_runs);
}

}  // namespace proofmass::coordinator
