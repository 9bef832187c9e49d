#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "worker/execution/execution.hpp"

namespace proofmass::test {

/// Finishes every run the moment it knows the run's campaign.
class NullExecution final : public worker::Execution {
 public:
  /// @param elapsed_s  What each run is said to have taken: the coordinator lends by it.
  explicit NullExecution(double elapsed_s) : elapsed_s_(elapsed_s) {}

  [[nodiscard]] bool is_defined(wire::CampaignId campaign) const override {
    return seeds_.contains(campaign);
  }
  void define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) override;
  void submit(wire::RunLease lease) override;
  [[nodiscard]] std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                                   std::span<const RunRange> ranges) override;
  [[nodiscard]] bool drop_batch(std::uint64_t) override { return false; }
  void forget(wire::CampaignId campaign) override;
  void abandon() override { waiting_.clear(); }
  [[nodiscard]] std::vector<worker::FinishedRun> take_finished() override;
  [[nodiscard]] std::vector<worker::RunningBatch> computing() const override { return {}; }
  [[nodiscard]] std::optional<worker::Duration> usual_batch_time() const override { return {}; }
  [[nodiscard]] std::uint64_t num_orbits_done() const override { return 0; }
  [[nodiscard]] std::optional<std::string> failure() const override { return {}; }

  [[nodiscard]] bool has_finished() const { return !finished_.empty(); }

 private:
  void finish(wire::CampaignId campaign, RunIndex run);

  double elapsed_s_;
  std::map<wire::CampaignId, std::uint64_t> seeds_;
  std::map<wire::CampaignId, std::set<RunIndex>> waiting_;  ///< For their campaign's definition.
  std::vector<worker::FinishedRun> finished_;
};

}  // namespace proofmass::test
