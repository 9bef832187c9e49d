#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <map>
#include <utility>

#include "core/math/hash.hpp"
#include "core/model.hpp"
#include "proto/wire/conversions.hpp"
#include "worker/execution/executor.hpp"

// How an executor serves a device: runs flow through it group by group, and the thread looks after
// it every few milliseconds.

namespace proofmass::worker {
namespace {

/// To the bit, in all that is sent of them.
bool are_same(const RunResult& a, const RunResult& b) {
  const auto bytes_of = [](const RunResult& result) {
    proto::ComputedRun message;
    wire::write_run({.result = result}, message);
    return message.SerializeAsString();
  };
  return bytes_of(a) == bytes_of(b);
}

/// Whether a run is one of those to be checked: as good as at random, and the same every time.
bool is_checked(RunIndex run, double fraction) { return fraction_of(mixed(run.value)) < fraction; }

/// Computes some of a device's runs again, on a thread of its own so that the device goes on.
class DeviceCheck {
 public:
  DeviceCheck(const Simulate& simulate, double fraction)
      : simulate_(simulate), fraction_(fraction) {}

  void add(const std::vector<RunRequest>& requests, const std::vector<RunResult>& results) {
    for (std::size_t i = 0; i < results.size(); ++i) {
      if (is_checked(results[i].run, fraction_)) waiting_.push_back({requests[i], results[i]});
    }
  }

  /// @throws DeviceError if the device was wrong.
  void go_on() {
    using namespace std::chrono_literals;
    if (running_.valid()) {
      if (running_.wait_for(0s) != std::future_status::ready) return;
      running_.get();
    }
    if (waiting_.empty()) return;
    const std::size_t count = std::min(waiting_.size(), model().batch_size());
    std::vector<Run> runs(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
    running_ = std::async(std::launch::async, [this, runs = std::move(runs)] { check(runs); });
  }

  /// All that is left.
  void end() {
    while (running_.valid() || !waiting_.empty()) {
      if (running_.valid()) running_.get();
      go_on();
    }
  }

 private:
  struct Run {
    RunRequest request;
    RunResult result;
  };

  void check(const std::vector<Run>& runs) const {
    std::vector<RunRequest> requests;
    for (const Run& run : runs) requests.push_back(run.request);
    const std::vector<RunResult> again = simulate_(requests, [](int) {});
    for (std::size_t i = 0; i < runs.size(); ++i) {
      if (are_same(again[i], runs[i].result)) continue;
      throw DeviceError(fmt::format(
          "run {} differs between device and processor: the device or its driver is broken, and no "
          "run of this worker can be trusted",
          runs[i].request.run.value));
    }
  }

  const Simulate& simulate_;
  double fraction_;
  std::vector<Run> waiting_;
  std::future<void> running_;
};

}  // namespace

void Executor::compute_on(Device& device, const std::shared_ptr<Batch>& first) {
  const std::shared_ptr<const PreparedCampaign> prepared = first->prepared;
  const std::unique_ptr<DeviceSimulation> simulation = prepared->simulate_on(device);
  DeviceCheck check(prepared->simulate, config_.checked_fraction);
  std::map<std::uint64_t, std::shared_ptr<Batch>> in_flight;
  const auto add = [&](const std::shared_ptr<Batch>& batch) {
    simulation->add(batch->number, batch->assignment.requests);
    in_flight[batch->number] = batch;
  };
  add(first);
  while (std::ranges::any_of(in_flight, [](const auto& b) { return !b.second->is_dropped; })) {
    while (simulation->num_in_flight() + simulation->group_size() <= simulation->capacity()) {
      const std::shared_ptr<Batch> next = next_batch_like(*first, simulation->group_size());
      if (next == nullptr) break;
      add(next);
    }
    const std::size_t num_together = simulation->num_in_flight();
    for (DeviceSimulation::Ended& ended : simulation->advance()) {
      const std::shared_ptr<Batch> batch = in_flight.extract(ended.group).mapped();
      check.add(batch->assignment.requests, ended.results);
      note_steps(*batch, prepared->num_steps);
      finish(*batch, std::move(ended.results), num_together);
    }
    for (const auto& [number, batch] : in_flight) {
      note_steps(*batch, simulation->num_steps_done(number));
    }
    check.go_on();
  }
  check.end();
}

}  // namespace proofmass::worker
