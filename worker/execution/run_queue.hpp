#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
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
  /// Whether runs of a campaign are wanted: those for cards, or those for processors.
  using IsWanted = std::function<bool(wire::CampaignId campaign, bool is_for_cards)>;

  /// Some runs of a lease.
  void add(const proto::RunLease& lease, std::span<const RunRange> runs);

  /// Removes the first run that is wanted, and the next ones of its campaign that are, whatever
  /// lease they are of; fewer than `count_max` if there are no more, none if none is wanted. A run
  /// that is to be alone is. If the lease of the first run wants smaller batches, this is one.
  [[nodiscard]] TakenRuns take(std::size_t count_max, const IsWanted& is_wanted);

  /// Removes those of the runs that are here and returns them in ascending order.
  std::vector<RunIndex> drop(wire::CampaignId campaign, std::span<const RunRange> ranges);
  void drop(wire::CampaignId campaign);
  void clear() { runs_.clear(); }

  [[nodiscard]] bool has(wire::CampaignId campaign) const;
  /// The campaign of the first run that is wanted; 0 if there is none.
  [[nodiscard]] wire::CampaignId first_campaign(const IsWanted& is_wanted) const;

 private:
  struct Waiting {
    wire::CampaignId campaign;
    bool is_alone = false;
    bool is_for_cards = false;
    std::uint32_t batch_runs_max = 0;
    RunRequest request;
  };

  std::list<Waiting> runs_;
};

}  // namespace proofmass::worker
