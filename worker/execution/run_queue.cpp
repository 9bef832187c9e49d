#include "worker/execution/run_queue.hpp"

#include <utility>

namespace proofmass::worker {

void RunQueue::add(wire::RunLease lease) { leases_.push_back(std::move(lease)); }

void RunQueue::clear() {
  leases_.clear();
  num_taken_ = 0;
}

std::vector<Assignment> RunQueue::take(std::size_t count_max) {
  std::vector<Assignment> assignments;
  while (assignments.size() < count_max && !empty()) assignments.push_back(take_first());
  return assignments;
}

std::vector<wire::LeaseId> RunQueue::leases() const {
  std::vector<wire::LeaseId> leases;
  for (const wire::RunLease& lease : leases_) leases.push_back(lease.lease);
  return leases;
}

Assignment RunQueue::take_first() {
  const wire::RunLease& lease = leases_.front();
  const std::size_t width = lease.table_values.size() / lease.runs.count;
  const auto values = lease.table_values.begin() + static_cast<std::ptrdiff_t>(num_taken_ * width);
  Assignment assignment{
      .lease = lease.lease,
      .attempt = lease.attempt,
      .request = {.run = {lease.runs.first.value + num_taken_},
                  .table_values = {values, values + static_cast<std::ptrdiff_t>(width)}}};
  if (++num_taken_ == lease.runs.count) {
    leases_.pop_front();
    num_taken_ = 0;
  }
  return assignment;
}

}  // namespace proofmass::worker
