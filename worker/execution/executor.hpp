#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <set>
#include <span>
#include <thread>

#include "core/campaign/run_result.hpp"
#include "core/simulation/run.hpp"
#include "worker/execution/execution.hpp"
#include "worker/execution/run_queue.hpp"

namespace proofmass::worker {

/// Computes some runs together; their results are in the order of the requests. Calls `progress`
/// now and then with the number of orbits that each of the runs has done. Called by several threads
/// at the same time.
using Simulate = std::function<std::vector<RunResult>(std::span<const RunRequest> requests,
                                                      const std::function<void(int)>& progress)>;

/// Prepares what the runs of a campaign share, which may take some time.
using Prepare = std::function<Simulate(const Campaign& campaign)>;

/// How much an executor computes at a time.
struct ExecutorConfig {
  std::size_t num_threads = 1;     ///< At least 1.
  std::size_t batch_size_max = 1;  ///< Runs that a thread computes together; at least 1.
};

/// Computes runs on threads of its own, in the order in which they are submitted.
///
/// A free thread takes a batch of runs from the queue, of as many leases as it takes, and starts at
/// once with what is there: a batch that is not full costs no more than a full one. Each run takes
/// the time of its batch, and that is its `compute_s`.
class Executor final : public Execution {
 public:
  /// @param prepare    Called on one of the threads, once a campaign, for all of them.
  /// @param on_change  Called on any of the threads when there is something new to take.
  Executor(Prepare prepare, std::function<void()> on_change, const ExecutorConfig& config);
  ~Executor() override;  ///< Abandons everything; waits at most for the orbits that are computed.

  void start(std::shared_ptr<const Campaign> campaign) override;
  void submit(wire::RunLease lease) override;
  void abandon() override;
  [[nodiscard]] std::vector<FinishedRun> take_finished() override;
  [[nodiscard]] std::vector<wire::LeaseId> open_leases() const override;
  [[nodiscard]] std::uint64_t num_orbits_done() const override { return num_orbits_done_; }
  [[nodiscard]] std::optional<std::string> failure() const override;

 private:
  /// Runs that one thread computes together.
  struct Batch {
    /// Shared with the executor, which replaces it when a new campaign starts.
    std::shared_ptr<const Simulate> simulate;
    std::vector<Assignment> assignments;
    std::uint64_t generation = 0;  ///< Of the executor when it was taken.
  };

  void serve();
  /// Waits for runs, and prepares their campaign if no other thread does; empty at the end.
  [[nodiscard]] std::optional<Batch> next_batch();
  void prepare(std::unique_lock<std::mutex>& lock);
  void compute(const Batch& batch);
  [[nodiscard]] std::vector<RunResult> simulate(const Batch& batch);
  void finish(const Batch& batch, std::vector<RunResult> results, double compute_s);
  void close(const Batch& batch);  ///< Its runs are no longer being computed.

  Prepare prepare_;
  std::function<void()> on_change_;
  ExecutorConfig config_;
  std::atomic<std::uint64_t> num_orbits_done_ = 0;
  /// Grows with every start() and abandon(): a batch of an older generation is dropped.
  std::atomic<std::uint64_t> generation_ = 0;

  mutable std::mutex mutex_;  ///< Guards all that follows but the threads.
  std::condition_variable changed_;
  bool is_ending_ = false;
  bool is_preparing_ = false;
  /// Shared with the thread that prepares it, even if another one starts meanwhile.
  std::shared_ptr<const Campaign> campaign_;
  std::shared_ptr<const Simulate> simulate_;  ///< Of `campaign_`; null until it is prepared.
  RunQueue queue_;
  std::multiset<wire::LeaseId> computing_;  ///< Of each run in a batch of any generation.
  std::vector<FinishedRun> finished_;
  std::optional<std::string> failure_;

  std::vector<std::thread> threads_;
};

}  // namespace proofmass::worker
