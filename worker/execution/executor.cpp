#include "worker/execution/executor.hpp"

#include <chrono>
#include <exception>
#include <utility>

#include "core/error.hpp"

namespace proofmass::worker {
namespace {

/// Leaves a simulation from within, between two orbits.
struct Abandoned {};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Executor::Executor(Prepare prepare, std::function<void()> on_change)
    : prepare_(std::move(prepare)),
      on_change_(std::move(on_change)),
      thread_([this] { serve(); }) {}

Executor::~Executor() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
    ++generation_;
  }
  changed_.notify_all();
  thread_.join();
}

void Executor::start(std::shared_ptr<const Campaign> campaign) {
  {
    const std::lock_guard lock(mutex_);
    campaign_ = std::move(campaign);
    queue_.clear();
    num_taken_ = 0;
    finished_.clear();
    ++generation_;
  }
  changed_.notify_all();
}

void Executor::submit(wire::RunLease lease) {
  {
    const std::lock_guard lock(mutex_);
    PROOFMASS_EXPECT(campaign_ != nullptr);
    queue_.push_back(std::move(lease));
  }
  changed_.notify_all();
}

void Executor::abandon() {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  num_taken_ = 0;
  ++generation_;
}

std::vector<FinishedRun> Executor::take_finished() {
  const std::lock_guard lock(mutex_);
  return std::exchange(finished_, {});
}

std::vector<wire::LeaseId> Executor::open_leases() const {
  const std::lock_guard lock(mutex_);
  std::vector<wire::LeaseId> leases;
  if (computing_) leases.push_back(*computing_);
  for (const wire::RunLease& lease : queue_) leases.push_back(lease.lease);
  return leases;
}

std::optional<std::string> Executor::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

void Executor::serve() {
  try {
    serve_campaigns();
  } catch (const std::exception& error) {
    {
      const std::lock_guard lock(mutex_);
      failure_ = error.what();
    }
    on_change_();
  }
}

void Executor::serve_campaigns() {
  Simulate simulate;
  std::shared_ptr<const Campaign> prepared;
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_ending_ || campaign_ != prepared; });
    if (is_ending_) return;
    prepared = campaign_;
    prepared_ = prepared;
    lock.unlock();
    simulate = prepare_(*prepared);
    while (const auto assignment = next_assignment()) compute(simulate, *assignment);
  }
}

std::optional<Executor::Assignment> Executor::next_assignment() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return is_ending_ || campaign_ != prepared_ || !queue_.empty(); });
  if (is_ending_ || campaign_ != prepared_) return std::nullopt;

  const wire::RunLease& lease = queue_.front();
  const std::size_t width = lease.table_values.size() / lease.runs.count;
  const auto values = lease.table_values.begin() + static_cast<std::ptrdiff_t>(num_taken_ * width);
  Assignment assignment{.lease = lease.lease,
                        .attempt = lease.attempt,
                        .run = {lease.runs.first.value + num_taken_},
                        .table_values = {values, values + static_cast<std::ptrdiff_t>(width)},
                        .generation = generation_};
  computing_ = lease.lease;
  if (++num_taken_ == lease.runs.count) {
    queue_.pop_front();
    num_taken_ = 0;
  }
  return assignment;
}

bool Executor::is_current(const Assignment& assignment) const {
  return assignment.generation == generation_;
}

void Executor::compute(const Simulate& simulate, const Assignment& assignment) {
  const auto on_orbit = [&](int) {
    ++num_orbits_done_;
    if (!is_current(assignment)) throw Abandoned{};
  };
  const auto start = std::chrono::steady_clock::now();
  try {
    wire::ComputedRun computed;
    computed.result = simulate(assignment.run, assignment.table_values, on_orbit);
    computed.compute_s = seconds_since(start);
    finish(assignment, std::move(computed));
  } catch (const Abandoned&) {
    const std::lock_guard lock(mutex_);
    computing_.reset();
  }
}

void Executor::finish(const Assignment& assignment, wire::ComputedRun computed) {
  {
    const std::lock_guard lock(mutex_);
    computing_.reset();
    if (!is_current(assignment)) return;
    finished_.push_back({.lease = assignment.lease,
                         .attempt = assignment.attempt,
                         .computed = std::move(computed)});
  }
  on_change_();
}

}  // namespace proofmass::worker
