#include "worker/execution/executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <map>
#include <utility>

#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "core/math/instruction_set.hpp"
#include "core/runs.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

/// Leaves a simulation from within, where it reports progress.
struct Abandoned {};

TimePoint now() { return std::chrono::steady_clock::now(); }

std::vector<RunRange> requested_ranges(const std::vector<RunRequest>& requests) {
  std::vector<RunIndex> runs;
  for (const RunRequest& request : requests) runs.push_back(request.run);
  std::ranges::sort(runs);
  return ranges_of(runs);
}

/// At the pace of the steps that are done; nothing if there are none.
std::optional<Duration> time_left(Duration elapsed, int num_done, int num_steps) {
  if (num_done < 1) return std::nullopt;
  return elapsed * std::max(0, num_steps - num_done) / num_done;
}

/// One more as long as it lives.
class Counted {
 public:
  explicit Counted(std::atomic<std::size_t>& count) : count_(count) { ++count_; }
  ~Counted() { --count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  std::atomic<std::size_t>& count_;
};

/// To the bit, in all that is sent of them.
bool are_same(const RunResult& a, const RunResult& b) {
  const auto bytes_of = [](const RunResult& result) {
    proto::ComputedRun message;
    wire::write_run({.result = result}, message);
    return message.SerializeAsString();
  };
  return bytes_of(a) == bytes_of(b);
}

/// @throws DeviceError if a device found something else than a processor.
void expect_same(const std::vector<RunResult>& results, const std::vector<RunResult>& of_device) {
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (are_same(results[i], of_device[i])) continue;
    throw DeviceError(fmt::format(
        "run {} differs between device and processor: the device or its driver is broken, and no "
        "run of this worker can be trusted",
        results[i].run.value));
  }
}

}  // namespace

Executor::Executor(Prepare prepare, std::function<void()> on_change, const ExecutorConfig& config)
    : prepare_(std::move(prepare)),
      on_change_(std::move(on_change)),
      config_(config),
      num_serving_(config.num_threads + config.devices.size()) {
  PROOFMASS_EXPECT(config.num_threads >= 1 && config.batch_size_max >= 1 &&
                   config.num_campaigns_max >= 1);
  for (std::size_t i = 0; i < config.num_threads; ++i) {
    threads_.emplace_back(
        [this] { serve(Place::processor, [this](const auto& batch) { compute(*batch); }); });
  }
  for (const std::shared_ptr<Device>& device : config.devices) {
    threads_.emplace_back([this, device] {
      serve(Place::device, [&](const auto& batch) { compute_on(*device, batch); });
    });
  }
}

Executor::~Executor() {
  (void)end_within(Duration::zero());
  for (std::thread& thread : threads_) thread.join();
}

bool Executor::end_within(Duration time_max) {
  std::unique_lock lock(mutex_);
  is_ending_ = true;
  queue_.clear();
  drop_batches([](const Batch&) { return true; });
  changed_.notify_all();
  return changed_.wait_for(lock, time_max, [&] { return num_serving_ == num_preparing_; });
}

bool Executor::is_defined(wire::CampaignId campaign) const {
  const std::lock_guard lock(mutex_);
  return campaigns_.contains(campaign);
}

void Executor::define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) {
  {
    const std::lock_guard lock(mutex_);
    PROOFMASS_EXPECT(definition != nullptr && !campaigns_.contains(campaign));
    make_room();
    campaigns_[campaign].definition = std::move(definition);
    campaigns_[campaign].used = ++num_uses_;
  }
  changed_.notify_all();
}

/// A campaign that a thread prepares stays, as do those with runs: it would be asked for again.
void Executor::make_room() {
  while (campaigns_.size() >= config_.num_campaigns_max) {
    auto oldest = campaigns_.end();
    for (auto known = campaigns_.begin(); known != campaigns_.end(); ++known) {
      if (is_in_use(known->first)) continue;
      if (oldest == campaigns_.end() || known->second.used < oldest->second.used) oldest = known;
    }
    if (oldest == campaigns_.end()) return;
    campaigns_.erase(oldest);
  }
}

bool Executor::is_in_use(wire::CampaignId campaign) const {
  const auto is_of_it = [&](const auto& batch) {
    return batch.second->assignment.campaign == campaign;
  };
  return campaigns_.at(campaign).is_preparing || queue_.has(campaign) ||
         std::ranges::any_of(batches_, is_of_it);
}

void Executor::submit(const proto::RunLease& lease, std::span<const RunRange> runs) {
  {
    const std::lock_guard lock(mutex_);
    queue_.add(lease, runs);
  }
  changed_.notify_all();
}

std::vector<RunIndex> Executor::drop_waiting(wire::CampaignId campaign,
                                             std::span<const RunRange> ranges) {
  const std::lock_guard lock(mutex_);
  return queue_.drop(campaign, ranges);
}

bool Executor::drop_batch(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  const std::size_t num_batches = batches_.size();
  drop_batches([&](const Batch& batch) { return batch.number == number; });
  return batches_.size() < num_batches;
}

void Executor::drop_batches(const std::function<bool(const Batch&)>& is_unwanted) {
  std::erase_if(batches_, [&](const auto& entry) {
    if (!is_unwanted(*entry.second)) return false;
    entry.second->is_dropped = true;
    return true;
  });
}

void Executor::forget(wire::CampaignId campaign) {
  const std::lock_guard lock(mutex_);
  queue_.drop(campaign);
  drop_batches([&](const Batch& batch) { return batch.assignment.campaign == campaign; });
  std::erase_if(finished_, [&](const wire::LeasedResult& run) { return run.campaign == campaign; });
  std::erase_if(crashed_, [&](const CrashedBatch& batch) { return batch.campaign == campaign; });
  campaigns_.erase(campaign);
}

void Executor::abandon() {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  drop_batches([](const Batch&) { return true; });
}

std::vector<wire::LeasedResult> Executor::take_finished() {
  const std::lock_guard lock(mutex_);
  return std::exchange(finished_, {});
}

std::vector<CrashedBatch> Executor::take_crashed() {
  const std::lock_guard lock(mutex_);
  return std::exchange(crashed_, {});
}

std::vector<RunningBatch> Executor::computing() const {
  const std::lock_guard lock(mutex_);
  std::vector<RunningBatch> running;
  for (const auto& [number, batch] : batches_) {
    const int num_done = batch->num_steps_done;
    running.push_back({.number = number,
                       .campaign = batch->assignment.campaign,
                       .ranges = requested_ranges(batch->assignment.requests),
                       .num_steps_done = static_cast<std::uint32_t>(num_done),
                       .time_left = time_left(now() - batch->started_at, num_done,
                                              batch->prepared->num_steps())});
  }
  return running;
}

std::optional<Duration> Executor::usual_batch_time() const {
  const std::lock_guard lock(mutex_);
  std::optional<Duration> longest;
  for (const auto& [id, known] : campaigns_) longest = std::max(longest, known.batch_time);
  return longest;
}

std::optional<std::string> Executor::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

void Executor::serve(Place place,
                     const std::function<void(const std::shared_ptr<Batch>&)>& compute) {
  bool has_failed = false;
  try {
    while (const std::shared_ptr<Batch> batch = next_batch(place)) compute(batch);
  } catch (const std::exception& error) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = error.what();
    has_failed = true;
  }
  if (has_failed) on_change_();
  const std::lock_guard lock(mutex_);
  --num_serving_;
  changed_.notify_all();
}

std::shared_ptr<Executor::Batch> Executor::next_batch(Place place) {
  const RunQueue::IsWanted is_wanted = wanted_by(place);
  std::unique_lock lock(mutex_);
  while (true) {
    if (is_ending_ || failure_) return nullptr;
    if (place == Place::processor && !checks_.empty()) {
      std::shared_ptr<Batch> check = std::move(checks_.back());
      checks_.pop_back();
      return check;
    }
    const wire::CampaignId first = queue_.first_campaign(is_wanted);
    TakenRuns assignment = queue_.take(size_max(place, first), is_wanted);
    if (!assignment.requests.empty()) return begin_batch(std::move(assignment), place);
    if (const wire::CampaignId campaign = campaign_to_prepare(); campaign.value != 0) {
      prepare(campaign, lock);
    } else {
      changed_.wait(lock);
    }
  }
}

std::shared_ptr<Executor::Batch> Executor::next_batch_like(const Batch& batch) {
  const RunQueue::IsWanted is_wanted = wanted_by(batch.place);
  const std::lock_guard lock(mutex_);
  if (is_ending_ || failure_) return nullptr;
  const wire::CampaignId campaign = batch.assignment.campaign;
  if (queue_.first_campaign(is_wanted) != campaign) return nullptr;
  return begin_batch(queue_.take(size_max(batch.place, campaign), is_wanted), batch.place);
}

std::shared_ptr<Executor::Batch> Executor::begin_batch(TakenRuns assignment, Place place) {
  KnownCampaign& known = campaigns_.at(assignment.campaign);
  known.used = ++num_uses_;
  const auto batch = std::make_shared<Batch>();
  batch->number = ++num_batches_;
  batch->assignment = std::move(assignment);
  batch->prepared = known.prepared;
  batch->started_at = now();
  batch->place = place;
  return batches_[batch->number] = batch;
}

std::size_t Executor::size_max(Place place, wire::CampaignId campaign) const {
  if (place == Place::device) return DeviceSimulation::group_size;
  const auto known = campaigns_.find(campaign);
  if (known == campaigns_.end()) return config_.batch_size_max;
  return std::min(config_.batch_size_max, known->second.definition->model().batch_size());
}

RunQueue::IsWanted Executor::wanted_by(Place place) const {
  return [this, place](wire::CampaignId campaign, bool is_for_cards) {
    const auto known = campaigns_.find(campaign);
    if (known == campaigns_.end() || known->second.prepared == nullptr) return false;
    const bool is_on_device =
        is_for_cards && !config_.devices.empty() && known->second.prepared->runs_on_devices();
    return is_on_device == (place == Place::device);
  };
}

wire::CampaignId Executor::campaign_to_prepare() const {
  return queue_.first_campaign([this](wire::CampaignId campaign, bool /*is_for_cards*/) {
    const auto found = campaigns_.find(campaign);
    return found != campaigns_.end() && !found->second.prepared && !found->second.is_preparing;
  });
}

void Executor::prepare(wire::CampaignId id, std::unique_lock<std::mutex>& lock) {
  const std::shared_ptr<const Campaign> definition = campaigns_.at(id).definition;
  campaigns_.at(id).is_preparing = true;
  const Counted counted(num_preparing_);  // Before anybody else has the lock.
  lock.unlock();
  std::shared_ptr<const Plan> prepared = prepare_(*definition);
  lock.lock();
  // It may have been forgotten meanwhile, and even defined again.
  const auto found = campaigns_.find(id);
  if (found != campaigns_.end() && found->second.definition == definition) {
    found->second.is_preparing = false;
    found->second.prepared = std::move(prepared);
  }
  changed_.notify_all();
}

void Executor::compute(Batch& batch) {
  try {
    std::vector<RunResult> results = simulate(batch);
    if (!batch.expected.empty()) return expect_same(results, batch.expected);
    const std::size_t num_together = results.size();
    finish(batch, std::move(results), num_together);
  } catch (const Abandoned&) {
    // The thread that dropped the batch has removed it from the list.
  } catch (const SimulationCrash& crash) {
    note_crash(batch, crash.what());
  } catch (const ConfigError& refusal) {  // Of parameters that were accepted for the campaign.
    note_crash(batch, refusal.what());
  }
}

void Executor::note_crash(const Batch& batch, const char* reason) {
  {
    const std::lock_guard lock(mutex_);
    if (batch.is_dropped || batches_.erase(batch.number) == 0) return;
    CrashedBatch& crashed = crashed_.emplace_back();
    crashed.campaign = batch.assignment.campaign;
    crashed.reason = reason;
    for (const RunRequest& request : batch.assignment.requests) crashed.runs.push_back(request.run);
  }
  on_change_();
}

std::vector<RunResult> Executor::simulate(Batch& batch) {
  const std::vector<RunRequest>& requests = batch.assignment.requests;
  const auto on_progress = [&](int num_steps_now) {
    if (batch.is_dropped || is_ending_) throw Abandoned{};
    if (batch.expected.empty()) note_steps(batch, num_steps_now);
  };
  std::vector<RunResult> results =
      batch.prepared->simulate_batch(requests, best_instruction_set(), on_progress);
  PROOFMASS_EXPECT(results.size() == requests.size());
  return results;
}

void Executor::note_steps(Batch& batch, int num_steps_now) {
  const int num_new = std::max(0, num_steps_now - batch.num_steps_done);
  batch.num_steps_done += num_new;
  num_steps_done_ += static_cast<std::uint64_t>(num_new) * batch.assignment.requests.size();
}

void Executor::finish(const Batch& batch, std::vector<RunResult> results,
                      std::size_t num_together) {
  const Duration elapsed = now() - batch.started_at;
  const double elapsed_s = std::chrono::duration<double>(elapsed).count();
  const double compute_s = elapsed_s / static_cast<double>(num_together);
  const wire::CampaignId campaign = batch.assignment.campaign;
  {
    const std::lock_guard lock(mutex_);
    if (batch.is_dropped) return;
    batches_.erase(batch.number);
    KnownCampaign& known = campaigns_.at(campaign);
    if (results.size() >= known.largest_batch) {
      known.largest_batch = results.size();
      known.batch_time = elapsed;
    }
    for (RunResult& result : results) {
      finished_.push_back({.campaign = campaign,
                           .attempt = {},
                           .computed = {.result = std::move(result),
                                        .compute_s = compute_s,
                                        .elapsed_s = elapsed_s,
                                        .is_by_card = batch.place == Place::device}});
    }
  }
  on_change_();
}

// Runs flow through a device group by group, and the thread looks after it every few milliseconds.

void Executor::compute_on(Device& device, const std::shared_ptr<Batch>& first) {
  const std::unique_ptr<DeviceSimulation> simulation = first->prepared->simulation_on(device);
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
      note_steps(*batch, batch->prepared->num_steps());
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
