#include "coordinator/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "coordinator/cli/campaign_start.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/progress_display.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/cli/worker_processes.hpp"
#include "coordinator/net/campaign_service.hpp"
#include "coordinator/net/private_endpoint.hpp"
#include "coordinator/report/report.hpp"
#include "core/simulation/run.hpp"

namespace proofmass::coordinator {
namespace {

constexpr int crashes_in_a_row_max = 3;

/// The local workers of a campaign: starts them, and others in the place of those that die.
class Crew {
 public:
  Crew(CampaignService& service, ProgressDisplay& display)
      : service_(service), display_(display), processes_(worker_executable(), service.endpoint()) {}

  void start(std::uint64_t num_workers) {
    for (std::uint64_t i = 1; i <= num_workers; ++i) {
      processes_.start(fmt::format("local-{}", i));
    }
  }

  /// @throws Error if workers die again and again without finishing a run.
  void replace_dead() {
    for (const WorkerProcesses::Exit& exit : processes_.take_exits()) {
      const auto process_id = static_cast<std::uint64_t>(exit.process_id);
      const std::string runs = to_text(service_.runs_held_by(process_id));
      count_crash(exit, runs);
      display_.note(fmt::format("worker {} (pid {}) ended: {}; it held runs {}; starting another",
                                exit.name, exit.process_id, exit.reason, runs));
      service_.process_ended(process_id, "process_ended");
      processes_.start(exit.name);
    }
  }

 private:
  void count_crash(const WorkerProcesses::Exit& exit, const std::string& runs) {
    const std::uint64_t num_done = service_.progress().num_done;
    num_crashes_ = num_done > num_done_at_crash_ ? 1 : num_crashes_ + 1;
    num_done_at_crash_ = num_done;
    if (num_crashes_ < crashes_in_a_row_max) return;
    throw Error(
        fmt::format("{} workers in a row ended without a finished run; the last, {}: {}, "
                    "holding runs {}",
                    num_crashes_, exit.name, exit.reason, runs));
  }

  CampaignService& service_;
  ProgressDisplay& display_;
  WorkerProcesses processes_;
  int num_crashes_ = 0;
  std::uint64_t num_done_at_crash_ = 0;
};

std::filesystem::path database_of(const RunOptions& options) {
  return options.database.value_or(options.campaign_file.stem().string() + ".db");
}

std::uint64_t num_missing(const Store& store) {
  std::uint64_t num_finished = 0;
  for (const RunRange& range : store.finished_runs()) num_finished += range.count;
  return store.num_runs() - num_finished;
}

/// No more than there are batches: runs of one batch take no longer than one of them.
std::uint64_t num_workers(const RunOptions& options, std::uint64_t num_runs_missing) {
  const unsigned num_processors = std::max(1U, std::thread::hardware_concurrency());
  const std::uint64_t num_batches = (num_runs_missing + batch_lanes - 1) / batch_lanes;
  return std::min<std::uint64_t>(options.num_workers.value_or(num_processors), num_batches);
}

/// What nobody needs to see while all goes well goes into the database only.
Log log_to(Store& store, ProgressDisplay& display) {
  return [&store, &display](const Event& event) {
    store.record_event(event.kind, event.text);
    if (event.severity == Severity::error) {
      display.note(fmt::format("proofmass: error: {} {}", event.kind, event.text));
    }
  };
}

/// Computes the missing runs; false if interrupted.
bool compute(const Campaign& campaign, Store& store, const RunOptions& options) {
  const std::uint64_t num_runs_missing = num_missing(store);
  if (num_runs_missing == 0) return true;
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  ProgressDisplay display(options.is_quiet ? DisplayMode::quiet : display_mode_for(stderr), stderr);
  const Log log = log_to(store, display);
  const PrivateEndpoint endpoint;
  CampaignService service(std::make_shared<const Campaign>(campaign), store.finished_runs(),
                          endpoint.address(), commit_to(store, log), log);
  Crew crew(service, display);
  crew.start(num_workers(options, num_runs_missing));
  const bool is_finished = service.run(stop, [&] {
    const CampaignProgress progress = service.progress();
    const bool needs_workers = stop == StopRequest::none && progress.num_done < progress.num_runs;
    if (needs_workers) crew.replace_dead();
    display.update(progress);
  });
  display.update(service.progress());
  return is_finished;
}

int say_interrupted(const Store& store, const std::filesystem::path& database) {
  const std::uint64_t num_runs = store.num_runs();
  fmt::print(stderr,
             "proofmass: interrupted; {} of {} runs are in {}\n"
             "proofmass: the same command computes the others\n",
             num_runs - num_missing(store), num_runs, database.string());
  return exit_interrupted;
}

}  // namespace

int run_campaign(const RunOptions& options) {
  const Campaign campaign = read_campaign(options.campaign_file, options.overrides);
  const std::filesystem::path database = database_of(options);
  Store store = open_or_create(campaign, database);
  const bool is_finished = compute(campaign, store, options);
  update_statistics(store, campaign.scenario);
  if (!is_finished) return say_interrupted(store, database);
  fmt::print("{}", report_text(store, campaign.scenario));
  return exit_done;
}

}  // namespace proofmass::coordinator
