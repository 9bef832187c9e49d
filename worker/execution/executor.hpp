#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <span>
#include <thread>

#include "core/campaign/run_result.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::worker {

/// Computes one run; calls the last argument after each orbit.
using Simulate = std::function<RunResult(RunIndex run, std::span<const double> table_values,
                                         const std::function<void(int)>& progress)>;

/// Prepares what the runs of a campaign share, which may take some time.
using Prepare = std::function<Simulate(const Campaign& campaign)>;

/// Computes runs on a thread of its own, one at a time, in the order in which they are submitted.
class Executor final : public Execution {
 public:
  /// @param prepare    Called on the executor's thread, as is what it returns.
  /// @param on_change  Called on that thread when there is something new to take.
  Executor(Prepare prepare, std::function<void()> on_change);
  ~Executor() override;  ///< Abandons everything; waits at most for the orbit that is computed.

  void start(std::shared_ptr<const Campaign> campaign) override;
  void submit(wire::RunLease lease) override;
  void abandon() override;
  [[nodiscard]] std::vector<FinishedRun> take_finished() override;
  [[nodiscard]] std::vector<wire::LeaseId> open_leases() const override;
  [[nodiscard]] std::uint64_t num_orbits_done() const override { return num_orbits_done_; }
  [[nodiscard]] std::optional<std::string> failure() const override;

 private:
  /// The next run of a queued lease.
  struct Assignment {
    wire::LeaseId lease;
    wire::Attempt attempt;
    RunIndex run;
    std::vector<double> table_values;
    std::uint64_t generation = 0;  ///< Of the executor when it was taken.
  };

  void serve();
  void serve_campaigns();
  void compute(const Simulate& simulate, const Assignment& assignment);
  /// Waits for the next run; empty if there is none for the campaign that is prepared.
  [[nodiscard]] std::optional<Assignment> next_assignment();
  void finish(const Assignment& assignment, wire::ComputedRun computed);
  [[nodiscard]] bool is_current(const Assignment& assignment) const;

  Prepare prepare_;
  std::function<void()> on_change_;
  std::atomic<std::uint64_t> num_orbits_done_ = 0;
  /// Grows with every start() and abandon(): a run of an older generation is dropped.
  std::atomic<std::uint64_t> generation_ = 0;

  mutable std::mutex mutex_;  ///< Guards all that follows but the thread.
  std::condition_variable changed_;
  bool is_ending_ = false;
  /// Shared with the thread, which may still be using an older one when a new campaign starts.
  std::shared_ptr<const Campaign> campaign_;
  std::shared_ptr<const Campaign> prepared_;
  std::deque<wire::RunLease> queue_;  ///< Of the first, the runs from `num_taken_` on are left.
  std::uint64_t num_taken_ = 0;
  std::optional<wire::LeaseId> computing_;
  std::vector<FinishedRun> finished_;
  std::optional<std::string> failure_;

  std::thread thread_;
};

}  // namespace proofmass::worker
