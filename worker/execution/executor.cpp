#include "worker/execution/executor.hpp"

#include <algorithm>
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

std::vector<RunRequest> requests_of(const std::vector<Assignment>& assignments) {
  std::vector<RunRequest> requests;
  for (const Assignment& assignment : assignments) requests.push_back(assignment.request);
  return requests;
}

}  // namespace

Executor::Executor(Prepare prepare, std::function<void()> on_change, const ExecutorConfig& config)
    : prepare_(std::move(prepare)), on_change_(std::move(on_change)), config_(config) {
  PROOFMASS_EXPECT(config.num_threads >= 1 && config.batch_size_max >= 1);
  for (std::size_t i = 0; i < config.num_threads; ++i) {
    threads_.emplace_back([this] { serve(); });
  }
}

Executor::~Executor() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
    ++generation_;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Executor::start(std::shared_ptr<const Campaign> campaign) {
  {
    const std::lock_guard lock(mutex_);
    campaign_ = std::move(campaign);
    simulate_.reset();
    queue_.clear();
    finished_.clear();
    ++generation_;
  }
  changed_.notify_all();
}

void Executor::submit(wire::RunLease lease) {
  {
    const std::lock_guard lock(mutex_);
    PROOFMASS_EXPECT(campaign_ != nullptr);
    queue_.add(std::move(lease));
  }
  changed_.notify_all();
}

void Executor::abandon() {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  ++generation_;
}

std::vector<FinishedRun> Executor::take_finished() {
  const std::lock_guard lock(mutex_);
  return std::exchange(finished_, {});
}

std::vector<wire::LeaseId> Executor::open_leases() const {
  const std::lock_guard lock(mutex_);
  const std::vector<wire::LeaseId> queued = queue_.leases();
  std::set<wire::LeaseId> leases(queued.begin(), queued.end());
  leases.insert(computing_.begin(), computing_.end());
  for (const FinishedRun& run : finished_) leases.insert(run.lease);
  return {leases.begin(), leases.end()};
}

std::optional<std::string> Executor::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

void Executor::serve() {
  try {
    while (const auto batch = next_batch()) compute(*batch);
  } catch (const std::exception& error) {
    {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = error.what();
    }
    changed_.notify_all();
    on_change_();
  }
}

std::optional<Executor::Batch> Executor::next_batch() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] {
      const bool can_prepare = campaign_ && !simulate_ && !is_preparing_;
      return is_ending_ || failure_ || can_prepare || (simulate_ && !queue_.empty());
    });
    if (is_ending_ || failure_) return std::nullopt;
    if (simulate_) break;
    prepare(lock);
  }
  Batch batch{.simulate = simulate_,
              .assignments = queue_.take(config_.batch_size_max),
              .generation = generation_};
  for (const Assignment& assignment : batch.assignments) computing_.insert(assignment.lease);
  return batch;
}

void Executor::prepare(std::unique_lock<std::mutex>& lock) {
  const std::shared_ptr<const Campaign> campaign = campaign_;
  is_preparing_ = true;
  lock.unlock();
  auto prepared = std::make_shared<const Simulate>(prepare_(*campaign));
  lock.lock();
  is_preparing_ = false;
  if (campaign_ == campaign) simulate_ = std::move(prepared);
  changed_.notify_all();
}

void Executor::compute(const Batch& batch) {
  const auto start = std::chrono::steady_clock::now();
  try {
    std::vector<RunResult> results = simulate(batch);
    finish(batch, std::move(results), seconds_since(start));
  } catch (const Abandoned&) {
    const std::lock_guard lock(mutex_);
    close(batch);
  }
}

std::vector<RunResult> Executor::simulate(const Batch& batch) {
  const std::vector<RunRequest> requests = requests_of(batch.assignments);
  int num_orbits = 0;
  const auto on_progress = [&](int num_orbits_now) {
    const int num_new = std::max(0, num_orbits_now - num_orbits);
    num_orbits += num_new;
    num_orbits_done_ += static_cast<std::uint64_t>(num_new) * requests.size();
    if (batch.generation != generation_) throw Abandoned{};
  };
  std::vector<RunResult> results = (*batch.simulate)(requests, on_progress);
  PROOFMASS_EXPECT(results.size() == requests.size());
  return results;
}

void Executor::finish(const Batch& batch, std::vector<RunResult> results, double compute_s) {
  {
    const std::lock_guard lock(mutex_);
    close(batch);
    if (batch.generation != generation_) return;
    for (std::size_t i = 0; i < results.size(); ++i) {
      const Assignment& assignment = batch.assignments[i];
      finished_.push_back({.lease = assignment.lease,
                           .attempt = assignment.attempt,
                           .computed = {.result = results[i], .compute_s = compute_s}});
    }
  }
  on_change_();
}

void Executor::close(const Batch& batch) {
  for (const Assignment& assignment : batch.assignments) {
    computing_.erase(computing_.find(assignment.lease));
  }
}

}  // namespace proofmass::worker
