#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/device.hpp"
#include "core/campaign/run_result.hpp"
#include "worker/execution/execution.hpp"
#include "worker/execution/run_queue.hpp"

namespace proofmass::worker {

/// Prepares what the runs of a campaign share, which may take some time.
using Prepare = std::function<std::shared_ptr<const Plan>(const Campaign& campaign)>;

/// How much an executor computes at a time.
struct ExecutorConfig {
  std::size_t num_threads = 1;        ///< At least 1.
  std::size_t batch_size_max = 1;     ///< Runs that a thread computes together, of any model; >= 1.
  std::size_t num_campaigns_max = 4;  ///< Kept without runs of theirs at hand; at least 1.
  /// Each is served by a thread of its own, beside `num_threads`.
  std::vector<std::shared_ptr<Device>> devices{};
  double checked_fraction = 0.0;  ///< Of a device's runs, which are computed here again.
};

/// Computes runs on threads of its own, in the order in which they are submitted.
///
/// A free thread takes a batch of runs of one campaign from the queue, of as many leases as it
/// takes, and starts at once with what is there. What each run took, `elapsed_s`, is the time of
/// its batch, of which it has an equal share in `compute_s`. A campaign is prepared by a thread
/// when its first run is due, while the others go on.
///
/// A device is given runs where many wait, since a few take it as long as many. Some of them are
/// computed by processors, too, before other runs; a device that differs ends the executor, as one
/// that fails does.
class Executor final : public Execution {
 public:
  /// @param prepare    Called on the threads, once for each definition.
  /// @param on_change  Called on any of the threads when there is something new to take.
  Executor(Prepare prepare, std::function<void()> on_change, const ExecutorConfig& config);
  /// Abandons everything; waits until all threads have prepared, report progress or end.
  ~Executor() override;

  [[nodiscard]] bool is_defined(wire::CampaignId campaign) const override;
  void define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) override;
  void submit(const proto::RunLease& lease, std::span<const RunRange> runs) override;
  [[nodiscard]] std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                                   std::span<const RunRange> ranges) override;
  [[nodiscard]] bool drop_batch(std::uint64_t number) override;
  void forget(wire::CampaignId campaign) override;
  void abandon() override;
  [[nodiscard]] std::vector<wire::LeasedResult> take_finished() override;
  [[nodiscard]] std::vector<CrashedBatch> take_crashed() override;
  [[nodiscard]] std::vector<RunningBatch> computing() const override;
  [[nodiscard]] std::optional<Duration> usual_batch_time() const override;
  [[nodiscard]] std::uint64_t num_steps_done() const override { return num_steps_done_; }
  [[nodiscard]] std::optional<std::string> failure() const override;

  /// Abandons everything and waits until no thread computes runs any more, at most for this time.
  /// False if one still does: it hangs, and the destructor would as well. It does not wait for
  /// threads that prepare a campaign, which cannot be interrupted and may take long.
  [[nodiscard]] bool end_within(Duration time_max);
  /// True if the destructor waits for the preparation of a campaign.
  [[nodiscard]] bool is_preparing() const { return num_preparing_ > 0; }

 private:
  struct KnownCampaign {
    std::shared_ptr<const Campaign> definition;  ///< Shared with the thread that prepares it.
    std::shared_ptr<const Plan> prepared;        ///< Shared with its batches; null until then.
    bool is_preparing = false;
    std::uint64_t used = 0;              ///< Grows with each use: the smallest is the longest ago.
    std::size_t largest_batch = 0;       ///< Runs of the largest batch so far.
    std::optional<Duration> batch_time;  ///< Of the last one among those that were as large.
  };

  enum class Place : std::uint8_t { processor, device };

  /// Runs that are computed together. The thread shares it with `batches_`, from which it is
  /// taken when it is dropped; a check is not listed there.
  struct Batch {
    std::uint64_t number = 0;
    TakenRuns assignment;
    std::shared_ptr<const Plan> prepared;
    TimePoint started_at;
    Place place = Place::processor;
    std::vector<RunResult> expected;  ///< What a device found. Empty if its results are wanted.
    std::atomic<int> num_steps_done = 0;
    std::atomic<bool> is_dropped = false;
  };

  /// What a thread serves: takes and computes batches until the end.
  void serve(Place place, const std::function<void(const std::shared_ptr<Batch>&)>& compute);
  /// Waits for runs, and prepares their campaign if no other thread does; null at the end.
  [[nodiscard]] std::shared_ptr<Batch> next_batch(Place place);
  /// More runs of the same campaign for the same place, if they wait; null if those of another one
  /// come first.
  [[nodiscard]] std::shared_ptr<Batch> next_batch_like(const Batch& batch);
  [[nodiscard]] std::shared_ptr<Batch> begin_batch(TakenRuns assignment, Place place);
  /// Runs for cards are wanted by devices, unless these cannot compute the campaign; all others by
  /// processors.
  [[nodiscard]] RunQueue::IsWanted wanted_by(Place place) const;
  [[nodiscard]] wire::CampaignId campaign_to_prepare() const;  ///< 0 if there is none.
  void prepare(wire::CampaignId id, std::unique_lock<std::mutex>& lock);
  [[nodiscard]] std::size_t size_max(Place place, wire::CampaignId campaign) const;
  void compute(Batch& batch);
  void compute_on(Device& device, const std::shared_ptr<Batch>& first);
  /// Has processors compute some of a device's runs again.
  void check_some(const Batch& batch, const std::vector<RunResult>& results);
  [[nodiscard]] std::vector<RunResult> simulate(Batch& batch);
  void note_steps(Batch& batch, int num_steps_now);
  /// @param num_together  Runs that shared the time of the batch.
  void finish(const Batch& batch, std::vector<RunResult> results, std::size_t num_together);
  void note_crash(const Batch& batch, const char* reason);
  void drop_batches(const std::function<bool(const Batch&)>& is_unwanted);
  void make_room();
  [[nodiscard]] bool is_in_use(wire::CampaignId campaign) const;

  Prepare prepare_;
  std::function<void()> on_change_;
  ExecutorConfig config_;
  std::atomic<std::uint64_t> num_steps_done_ = 0;
  std::atomic<std::size_t> num_preparing_ = 0;  ///< Threads that do; grows under the mutex only.

  mutable std::mutex mutex_;  ///< Guards all that follows but the threads.
  std::condition_variable changed_;
  std::atomic<bool> is_ending_ = false;  ///< Read without the mutex, too.
  std::size_t num_serving_ = 0;          ///< Threads that have not come to their end.
  std::uint64_t num_uses_ = 0;
  std::uint64_t num_batches_ = 0;
  std::map<wire::CampaignId, KnownCampaign> campaigns_;
  RunQueue queue_;
  std::map<std::uint64_t, std::shared_ptr<Batch>> batches_;
  std::vector<std::shared_ptr<Batch>> checks_;  ///< Runs of devices that are to be computed again.
  std::vector<wire::LeasedResult> finished_;
  std::vector<CrashedBatch> crashed_;
  std::optional<std::string> failure_;

  std::vector<std::thread> threads_;
};

}  // namespace proofmass::worker
