#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <span>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class RunLease;
}  // namespace proofmass::proto

namespace proofmass::worker {

/// Runs of one campaign that are to be computed together.
struct TakenRuns {
  wire::CampaignId campaign;
  std::vector<RunRequest> requests;  ///< Not empty.
};

/// The runs of a worker that nobody has begun to compute, in the order in which they came.
class RunQueue {
 public:
  using IsReady = std::function<bool(wire::CampaignId)>;

  /// Some runs of a lease.
  void add(const proto::RunLease& lease, std::span<const RunRange> runs);

  /// Removes the first run whose campaign is ready, and the next ones of that campaign, whatever
  /// lease they are of; fewer than `count_max` if there are no more, none if no campaign is ready.
  /// A run that is to be alone is. If the lease of the first run wants smaller batches, this is
  /// one. Runs for cards are left to these if `are_on_cards` holds for their campaign.
  [[nodiscard]] TakenRuns take(std::size_t count_max, const IsReady& is_ready,
                               const IsReady& are_on_cards);

  /// Removes the first run for cards whose campaign is ready, and the next ones of that campaign.
  /// @param wanted  None if the first run is of another campaign than this.
  [[nodiscard]] TakenRuns take_for_device(std::size_t count_max, const IsReady& is_ready,
                                          std::optional<wire::CampaignId> wanted = std::nullopt);

  /// Removes those of the runs that are here and returns them in ascending order.
  std::vector<RunIndex> drop(wire::CampaignId campaign, std::span<const RunRange> ranges);
  void drop(wire::CampaignId campaign);
  void clear() { runs_.clear(); }

  [[nodiscard]] bool has(wire::CampaignId campaign) const;
  /// The first campaign with a run here for which `is_wanted` holds; 0 if there is none.
  [[nodiscard]] wire::CampaignId first_campaign(const IsReady& is_wanted) const;

 private:
  struct Waiting {
    wire::CampaignId campaign;
    bool is_alone = false;
    bool is_for_cards = false;
    std::uint32_t batch_runs_max = 0;
    RunRequest request;
  };

  /// The campaign of the first run that fits; 0 if there is none.
  [[nodiscard]] wire::CampaignId campaign_of_first(
      const std::function<bool(const Waiting&)>& is_fit) const;

  std::list<Waiting> runs_;
};

}  // namespace proofmass::worker
