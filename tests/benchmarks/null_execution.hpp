#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "worker/execution/execution.hpp"
#include "worker/execution/run_queue.hpp"

namespace proofmass::test {

/// How long runs take that compute nothing.
struct NullPace {
  /// Of a batch of 16 runs; from one to the next it varies by a tenth. Zero: every run is finished
  /// the moment its campaign is known.
  double batch_time_s = 0.0;
  std::size_t num_threads = 1;  ///< Batches at a time, if they take time.
  double elapsed_s = 0.0;       ///< What a run is said to have taken if it took no time.
};

/// Takes the time of runs and makes their results up.
class NullExecution final : public worker::Execution {
 public:
  using TimePoint = worker::TimePoint;

  explicit NullExecution(const NullPace& pace) : pace_(pace) {}

  /// Finishes batches whose time is over, and begins others.
  void advance(TimePoint now);
  /// When advance() is to be called next; nothing if there is no batch.
  [[nodiscard]] std::optional<TimePoint> due_at() const { return due_at_; }
  [[nodiscard]] bool has_finished() const { return !finished_.empty(); }

  [[nodiscard]] bool is_defined(wire::CampaignId campaign) const override {
    return campaigns_.contains(campaign);
  }
  void define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) override;
  void submit(const proto::RunLease& lease, std::span<const RunRange> runs) override;
  [[nodiscard]] std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                                   std::span<const RunRange> ranges) override;
  [[nodiscard]] bool drop_batch(std::uint64_t number) override;
  void forget(wire::CampaignId campaign) override;
  void abandon() override;
  [[nodiscard]] std::vector<wire::LeasedResult> take_finished() override;
  [[nodiscard]] std::vector<worker::RunningBatch> computing() const override;
  [[nodiscard]] std::optional<worker::Duration> usual_batch_time() const override { return {}; }
  [[nodiscard]] std::uint64_t num_steps_done() const override { return num_steps_done_; }
  [[nodiscard]] std::optional<std::string> failure() const override { return {}; }

 private:
  struct Batch {
    worker::TakenRuns assignment;
    TimePoint started_at;
    TimePoint due_at;
  };

  void begin_batches(TimePoint now);
  [[nodiscard]] worker::Duration time_of_batch(std::uint64_t number) const;
  [[nodiscard]] int num_steps_done(const Batch& batch) const;
  void finish(const worker::TakenRuns& assignment, double elapsed_s);
  void note_due();

  NullPace pace_;
  TimePoint now_;
  std::optional<TimePoint> due_at_;
  std::map<wire::CampaignId, std::shared_ptr<const Campaign>> campaigns_;
  worker::RunQueue waiting_;
  std::map<std::uint64_t, Batch> batches_;  ///< By number.
  std::uint64_t num_batches_ = 0;           ///< Begun.
  std::uint64_t num_steps_done_ = 0;        ///< Of all runs of batches that are finished.
  std::vector<wire::LeasedResult> finished_;
};

}  // namespace proofmass::test
