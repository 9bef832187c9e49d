// Whether batches are full, and when the last one ends: workers that compute batches, in a time of
// their own.

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <vector>

#include "coordinator/dispatch/campaigns.hpp"
#include "coordinator/dispatch/results.hpp"
#include "coordinator/dispatch/workers.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/coordinator/dispatch/invariants.hpp"

namespace proofmass::coordinator {
namespace {

/// A run that a worker holds.
struct HeldRun {
  wire::Attempt attempt;
  RunIndex run;
};

/// How long a batch of so many runs takes.
using BatchTime = std::function<double(std::size_t num_runs)>;

/// What a thread of a worker computes.
struct PlayedBatch {
  std::vector<HeldRun> runs;  ///< Empty: the thread is idle.
  double begins = 0.0;
  double ends = 0.0;
};

/// A worker: each of its threads takes what is there, up to a batch.
struct PlayedWorker {
  std::deque<HeldRun> queue;
  std::vector<PlayedBatch> threads;

  void take_batches(double now, const BatchTime& batch_time) {
    for (PlayedBatch& batch : threads) {
      if (!batch.runs.empty() || queue.empty()) continue;
      const std::size_t count = std::min(queue.size(), batch_lanes);
      const auto end = queue.begin() + static_cast<std::ptrdiff_t>(count);
      batch.runs.assign(queue.begin(), end);
      queue.erase(queue.begin(), end);
      batch.begins = now;
      batch.ends = now + batch_time(count);
    }
  }
};

/// A campaign whose store commits at once and whose messages arrive at once.
class PlayedFleet final : public Outbox {
 public:
  PlayedFleet(std::uint64_t num_runs, std::size_t num_workers, std::size_t num_threads,
              std::vector<RunRange> finished = {}) {
    MicroscopeCampaign campaign;
    campaign.num_runs = num_runs;
    state_ = initial_state({}, {}, {});
    on_campaign(state_, id_,
                {.definition = std::make_shared<const MicroscopeCampaign>(campaign),
                 .finished = std::move(finished),
                 .given_up = {},
                 .blamed = {}},
                {}, *this);
    const wire::Hello hello{.worker_name = "w",
                            .host = "h",
                            .process_id = 1,
                            .num_slots = static_cast<std::uint32_t>(num_threads * batch_lanes),
                            .model_version = std::string(model_version),
                            .build = "test",
                            .former = {}};
    for (std::uint64_t i = 1; i <= num_workers; ++i) {
      workers_[WorkerId{i}].threads.resize(num_threads);
      on_hello(state_, WorkerId{i}, SessionId{i}, "", hello, {}, *this);
      on_heartbeat(state_, WorkerId{i},
                   {.num_runs_max = wire::runs_per_lease_max, .held = {}, .computing = {}}, 1, {},
                   *this);
    }
  }

  /// Time until the campaign is finished.
  double play(const BatchTime& batch_time) {
    double now = 0.0;
    while (!is_finished(state_.campaigns.at(id_))) {
      for (auto& [id, worker] : workers_) worker.take_batches(now, batch_time);
      now = next_end();
      for (auto& [id, worker] : workers_) {
        for (std::size_t i = 0; i < worker.threads.size(); ++i) {
          const PlayedBatch& batch = worker.threads[i];
          if (!batch.runs.empty() && batch.begins < now && batch.ends <= now) {
            deliver(id, i, batch_time);
          }
        }
      }
      check_invariants(state_);
    }
    return now;
  }

  [[nodiscard]] int num_partial_batches() const { return num_partial_batches_; }

  void send(WorkerId id, wire::Message message) override {
    const auto* const lease = std::get_if<wire::RunLease>(&message);
    if (lease == nullptr) return;
    PlayedWorker& worker = workers_.at(id);
    for (std::uint64_t run = lease->runs.first.value; run < lease->runs.end(); ++run) {
      worker.queue.push_back({.attempt = lease->attempt, .run = {run}});
    }
  }
  void send_definition(WorkerId, const wire::CampaignRequest&,
                       const std::shared_ptr<const Campaign>&) override {}
  void store(WorkerId, wire::LeasedResult result) override {
    stored_.push_back(result.computed.result.run);
  }
  void compare(WorkerId, wire::LeasedResult) override {
    ADD_FAILURE() << "a run was computed twice";
  }
  void record(const Loss&) override { ADD_FAILURE() << "runs were lost"; }
  void give_up(CampaignId, RunIndex) override { ADD_FAILURE() << "a run was given up"; }
  void log(Event, CampaignId) override {}

 private:
  [[nodiscard]] double next_end() const {
    double next = std::numeric_limits<double>::infinity();
    for (const auto& [id, worker] : workers_) {
      for (const PlayedBatch& batch : worker.threads) {
        if (!batch.runs.empty()) next = std::min(next, batch.ends);
      }
    }
    return next;
  }

  /// One message an attempt, as workers send them. The thread is free before its results arrive: it
  /// finds what was lent before.
  void deliver(WorkerId id, std::size_t thread, const BatchTime& batch_time) {
    const PlayedBatch batch = std::exchange(workers_.at(id).threads[thread], {});
    if (batch.runs.size() < batch_lanes) ++num_partial_batches_;
    std::map<wire::Attempt, wire::ResultBatch> messages;
    for (const HeldRun& held : batch.runs) {
      wire::ComputedRun computed;
      computed.result.run = held.run;
      computed.result.num_draws = 1;
      computed.elapsed_s = batch.ends - batch.begins;
      messages[held.attempt].campaign = id_;
      messages[held.attempt].attempt = held.attempt;
      messages[held.attempt].results.push_back(computed);
    }
    workers_.at(id).take_batches(batch.ends, batch_time);
    for (const auto& [attempt, message] : messages) {
      on_results(state_, id, message, {}, *this);
      on_committed(state_, id_, std::exchange(stored_, {}), {}, *this);
    }
  }

  const CampaignId id_{1};
  State state_;
  std::map<WorkerId, PlayedWorker> workers_;
  std::vector<RunIndex> stored_;
  int num_partial_batches_ = 0;
};

TEST(BatchRounds, AreAsFewAsTheyCanBe) {
  for (const std::uint64_t num_runs : {1U, 16U, 17U, 100U, 300U, 1000U, 5000U}) {
    for (const std::size_t num_workers : {1U, 2U, 3U, 8U}) {
      for (const std::size_t num_threads : {1U, 2U, 7U}) {
        for (const double batch_time_s : {0.1, 2.4, 60.0}) {
          const std::uint64_t num_batches = (num_runs + batch_lanes - 1) / batch_lanes;
          const std::size_t num_at_a_time = num_workers * num_threads;
          const auto fewest = static_cast<int>((num_batches + num_at_a_time - 1) / num_at_a_time);
          PlayedFleet fleet(num_runs, num_workers, num_threads);
          const double time_s = fleet.play([&](std::size_t) { return batch_time_s; });
          EXPECT_EQ(std::lround(time_s / batch_time_s), fewest)
              << num_runs << " runs, " << num_workers << " workers of " << num_threads
              << " threads, " << batch_time_s << " s a batch";
          EXPECT_LE(fleet.num_partial_batches(), 1);
        }
      }
    }
  }
}

// Every tenth run is there already, so that no lease holds more than nine. Batches are full until
// nothing waits any more, two rounds before the end.
TEST(BatchRounds, AreAsFewAndOneIfLeasesAreSmallerThanBatches) {
  std::vector<RunRange> finished;
  for (std::uint64_t run = 0; run < 1000; run += 10) finished.push_back({{run}, 1});
  PlayedFleet fleet(1000, 2, 2, finished);
  const double time_s = fleet.play([](std::size_t) { return 2.4; });
  EXPECT_LE(time_s, 2.4 * (15 + 1) + 1e-9);  // 900 runs are 56.25 batches, four at a time.
  EXPECT_LE(fleet.num_partial_batches(), 2 * 4);
}

// Times of batches as they were measured with AVX-512, in units of a full one: 0.55 for up to 8
// runs. No worker may idle for long at the end: a campaign takes at most 1.2 times what its work
// would take if it could be shared out at will, and one narrow batch.
TEST(BatchTimes, LeaveNoWorkerIdleForLong) {
  struct Case {
    std::uint64_t num_runs;
    std::size_t num_workers;
    std::size_t num_threads;
  };
  constexpr double narrow = 0.55;
  constexpr std::size_t narrow_runs = 8;
  for (const Case& played : {Case{100, 16, 1}, Case{1000, 64, 1}, Case{100, 2, 1}, Case{1000, 2, 1},
                             Case{1000, 16, 4}, Case{5000, 64, 1}}) {
    PlayedFleet fleet(played.num_runs, played.num_workers, played.num_threads);
    const double time =
        fleet.play([](std::size_t num_runs) { return num_runs <= narrow_runs ? narrow : 1.0; });
    const double work = static_cast<double>(played.num_runs) / batch_lanes;
    const auto num_threads = static_cast<double>(played.num_workers * played.num_threads);
    EXPECT_LE(time, 1.2 * (work / num_threads + narrow))
        << played.num_runs << " runs, " << played.num_workers << " workers of "
        << played.num_threads << " threads";
  }
}

}  // namespace
}  // namespace proofmass::coordinator
