#include <algorithm>
#include <map>
#include <utility>

#include "core/math/hash.hpp"
#include "worker/execution/executor.hpp"

// How an executor serves a device: runs flow through it group by group, and the thread looks after
// it every few milliseconds.

namespace proofmass::worker {

void Executor::compute_on(Device& device, const std::shared_ptr<Batch>& first) {
  const std::unique_ptr<DeviceSimulation> simulation = first->prepared->simulate_on(device);
  std::map<std::uint64_t, std::shared_ptr<Batch>> in_flight;
  const auto add = [&](const std::shared_ptr<Batch>& batch) {
    simulation->add(batch->number, batch->assignment.requests);
    in_flight[batch->number] = batch;
  };
  add(first);
  while (std::ranges::any_of(in_flight, [](const auto& b) { return !b.second->is_dropped; })) {
    while (simulation->num_in_flight() + simulation->group_size <= simulation->capacity()) {
      const std::shared_ptr<Batch> next = next_batch_like(*first);
      if (next == nullptr) break;
      add(next);
    }
    const std::size_t num_together = simulation->num_in_flight();
    for (DeviceSimulation::Ended& ended : simulation->advance()) {
      const std::shared_ptr<Batch> batch = in_flight.extract(ended.group).mapped();
      check_some(*batch, ended.results);
      note_steps(*batch, batch->prepared->num_steps);
      finish(*batch, std::move(ended.results), num_together);
    }
    for (const auto& [number, batch] : in_flight) {
      note_steps(*batch, simulation->num_steps_done(number));
    }
  }
}

void Executor::check_some(const Batch& batch, const std::vector<RunResult>& results) {
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < results.size(); ++i) {
      // As good as at random, and the same runs every time.
      if (fraction_of(mixed(results[i].run.value)) >= config_.checked_fraction) continue;
      const bool has_room = !checks_.empty() && checks_.back()->prepared == batch.prepared &&
                            checks_.back()->expected.size() < config_.batch_size_max;
      if (!has_room) {
        checks_.push_back(std::make_shared<Batch>());
        checks_.back()->prepared = batch.prepared;
      }
      checks_.back()->assignment.requests.push_back(batch.assignment.requests[i]);
      checks_.back()->expected.push_back(results[i]);
    }
  }
  changed_.notify_all();
}

}  // namespace proofmass::worker
