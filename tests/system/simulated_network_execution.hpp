#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::test {

/// A run of one of several campaigns.
using RunKey = std::pair<wire::CampaignId, RunIndex>;

/// What runs begin with.
using Draws = std::map<RunKey, RunDraw>;

/// Runs that do not end as they should, whoever computes them.
struct Poison {
  std::set<RunKey> crashing;
  std::set<RunKey> crashing_outside;  ///< Not with their worker.
  std::set<RunKey> hanging;
  [[nodiscard]] bool has(const RunKey& run) const {
    return crashing.contains(run) || crashing_outside.contains(run) || hanging.contains(run);
  }
};

/// Computes runs in simulated time: in batches, some at a time, step by step.
class PlayedExecution final : public worker::Execution {
 public:
  /// @param poison, draws  Outlive this object.
  /// @param has_cards      Runs for cards are computed by some, apart from the others.
  PlayedExecution(const Poison& poison, const Draws& draws, std::size_t num_threads,
                  std::size_t num_lanes, bool has_cards);

  bool is_defined(wire::CampaignId campaign) const override { return defined_.contains(campaign); }
  /// Nothing depends on what the definition says, and to read it takes longer than all else here.
  std::shared_ptr<const Campaign> read(Definition) const override {
    return std::make_shared<const MicroscopeCampaign>();
  }
  void define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) override;
  void submit(const proto::RunLease& lease, std::span<const RunRange> runs) override;
  std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                     std::span<const RunRange> ranges) override;
  bool drop_batch(std::uint64_t number) override;
  void forget(wire::CampaignId campaign) override;
  void abandon() override;
  std::vector<wire::LeasedResult> take_finished() override { return std::exchange(finished_, {}); }
  std::vector<worker::CrashedBatch> take_crashed() override { return std::exchange(crashed_, {}); }
  std::vector<worker::RunningBatch> computing() const override;
  std::optional<worker::Duration> usual_batch_time() const override { return std::nullopt; }
  std::uint64_t num_steps_done() const override { return num_steps_done_; }
  std::optional<std::string> failure() const override { return std::nullopt; }

  /// What an advance comes to.
  enum class Outcome : std::uint8_t { nothing, finished, crashed };

  /// Begins batches, or lets each of those that have begun do a step.
  Outcome advance();
  [[nodiscard]] bool is_computing() const { return !batches_.empty(); }

 private:
  struct WaitingRun {
    RunKey run;
    bool is_alone = false;
    bool is_for_cards = false;
  };
  struct Batch {
    std::uint64_t number = 0;
    bool is_by_card = false;
    std::vector<RunKey> runs;
    std::uint32_t num_steps_done = 0;
  };

  [[nodiscard]] std::optional<Batch> next_batch();

  const Poison& poison_;
  const Draws& draws_;
  std::size_t num_threads_;
  std::size_t num_lanes_;
  bool has_cards_;
  std::set<wire::CampaignId> defined_;
  std::deque<WaitingRun> waiting_;
  std::vector<Batch> batches_;
  std::vector<wire::LeasedResult> finished_;
  std::vector<worker::CrashedBatch> crashed_;
  std::uint64_t next_batch_ = 1;
  std::uint64_t num_steps_done_ = 0;
};

}  // namespace proofmass::test
