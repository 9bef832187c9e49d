#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "core/simulation/run.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::worker {

/// A run that is to be computed, and the lease that it belongs to.
struct Assignment {
  wire::LeaseId lease;
  wire::Attempt attempt;
  RunRequest request;
};

/// The runs of a worker's leases that nobody has begun to compute, in the order in which they came.
class RunQueue {
 public:
  void add(wire::RunLease lease);
  void clear();

  /// Removes the first runs, of as many leases as it takes; fewer than `count_max` if there are no
  /// more.
  [[nodiscard]] std::vector<Assignment> take(std::size_t count_max);

  [[nodiscard]] bool empty() const { return leases_.empty(); }
  [[nodiscard]] std::vector<wire::LeaseId> leases() const;  ///< Those with a run in the queue.

 private:
  [[nodiscard]] Assignment take_first();

  std::deque<wire::RunLease> leases_;  ///< Of the first, the runs from `num_taken_` on are left.
  std::uint64_t num_taken_ = 0;
};

}  // namespace proofmass::worker
