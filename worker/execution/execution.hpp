#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::worker {

/// A finished run and the lease that it belongs to.
struct FinishedRun {
  wire::LeaseId lease;
  wire::Attempt attempt;
  wire::ComputedRun computed;
};

/// What the conversation with a coordinator needs of whatever computes runs. Neither knows how the
/// other works.
class Execution {
 public:
  virtual ~Execution() = default;

  /// Begins with this campaign; forgets everything of the one before.
  virtual void start(std::shared_ptr<const Campaign> campaign) = 0;
  /// Queues the runs of a lease. @pre start() has been called.
  virtual void submit(wire::RunLease lease) = 0;
  /// Drops all runs that are not finished, also those that are being computed.
  virtual void abandon() = 0;

  /// Finished runs, each handed out once, in the order in which they finished.
  [[nodiscard]] virtual std::vector<FinishedRun> take_finished() = 0;
  /// Leases with a run that take_finished() has not handed out, each once, in order.
  [[nodiscard]] virtual std::vector<wire::LeaseId> open_leases() const = 0;
  [[nodiscard]] virtual std::uint64_t num_orbits_done() const = 0;
  /// Why no run can be computed any more, if so.
  [[nodiscard]] virtual std::optional<std::string> failure() const = 0;
};

}  // namespace proofmass::worker
