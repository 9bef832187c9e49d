#include "tests/benchmarks/null_execution.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/math/hash.hpp"
#include "core/runs.hpp"
#include "tests/benchmarks/null_result.hpp"

namespace proofmass::test {
namespace {

constexpr std::size_t batch_size = 16;
constexpr int num_steps = 140;  ///< Of a run of the paper's campaign.

std::vector<RunRange> ranges_of_requests(const std::vector<RunRequest>& requests) {
  std::vector<RunIndex> runs;
  for (const RunRequest& request : requests) runs.push_back(request.run);
  std::ranges::sort(runs);
  return ranges_of(runs);
}

}  // namespace

void NullExecution::define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) {
  std::shared_ptr<Campaign> extended = definition->clone();
  extended->num_runs = num_runs_max;  // It may be.
  campaigns_[campaign] = std::move(extended);
  advance(now_);
}

void NullExecution::submit(const proto::RunLease& lease, std::span<const RunRange> runs) {
  waiting_.add(lease, runs);
  advance(now_);
}

void NullExecution::advance(TimePoint now) {
  now_ = now;
  std::erase_if(batches_, [&](const auto& entry) {
    const Batch& batch = entry.second;
    if (batch.due_at > now) return false;
    finish(batch.assignment,
           std::chrono::duration<double>(batch.due_at - batch.started_at).count());
    return true;
  });
  begin_batches(now);
  note_due();
}

void NullExecution::begin_batches(TimePoint now) {
  const auto is_known = [&](wire::CampaignId campaign, bool) { return is_defined(campaign); };
  const bool takes_time = pace_.batch_time_s > 0.0;
  const std::size_t size_max = takes_time ? batch_size : std::numeric_limits<std::size_t>::max();
  while (batches_.size() < pace_.num_threads) {
    worker::TakenRuns assignment = waiting_.take(size_max, is_known);
    if (assignment.requests.empty()) return;
    if (!takes_time) {
      finish(assignment, pace_.elapsed_s);
      continue;
    }
    const std::uint64_t number = ++num_batches_;
    batches_[number] = {.assignment = std::move(assignment),
                        .started_at = now,
                        .due_at = now + time_of_batch(number)};
  }
}

worker::Duration NullExecution::time_of_batch(std::uint64_t number) const {
  const double factor = 0.9 + 0.2 * fraction_of(mixed(number));
  return std::chrono::duration_cast<worker::Duration>(
      std::chrono::duration<double>(factor * pace_.batch_time_s));
}

void NullExecution::note_due() {
  due_at_.reset();
  for (const auto& [number, batch] : batches_) {
    due_at_ = std::min(due_at_.value_or(batch.due_at), batch.due_at);
  }
}

std::vector<RunIndex> NullExecution::drop_waiting(wire::CampaignId campaign,
                                                  std::span<const RunRange> ranges) {
  return waiting_.drop(campaign, ranges);
}

bool NullExecution::drop_batch(std::uint64_t number) { return batches_.erase(number) > 0; }

void NullExecution::forget(wire::CampaignId campaign) {
  waiting_.drop(campaign);
  campaigns_.erase(campaign);
  std::erase_if(batches_,
                [&](const auto& entry) { return entry.second.assignment.campaign == campaign; });
  std::erase_if(finished_, [&](const auto& run) { return run.campaign == campaign; });
}

void NullExecution::abandon() {
  waiting_.clear();
  batches_.clear();
}

std::vector<wire::LeasedResult> NullExecution::take_finished() {
  return std::exchange(finished_, {});
}

std::vector<worker::RunningBatch> NullExecution::computing() const {
  std::vector<worker::RunningBatch> running;
  for (const auto& [number, batch] : batches_) {
    running.push_back({.number = number,
                       .campaign = batch.assignment.campaign,
                       .ranges = ranges_of_requests(batch.assignment.requests),
                       .num_steps_done = static_cast<std::uint32_t>(num_steps_done(batch)),
                       .time_left = std::max(worker::Duration::zero(), batch.due_at - now_)});
  }
  return running;
}

int NullExecution::num_steps_done(const Batch& batch) const {
  const double fraction = std::chrono::duration<double>(now_ - batch.started_at) /
                          std::chrono::duration<double>(batch.due_at - batch.started_at);
  return static_cast<int>(num_steps * std::clamp(fraction, 0.0, 1.0));
}

void NullExecution::finish(const worker::TakenRuns& assignment, double elapsed_s) {
  const Campaign& campaign = *campaigns_.at(assignment.campaign);
  for (const RunRequest& request : assignment.requests) {
    finished_.push_back(
        {.campaign = assignment.campaign,
         .attempt = {},
         .computed = {.result = null_result(campaign, request.run), .elapsed_s = elapsed_s}});
  }
  num_steps_done_ += assignment.requests.size() * num_steps;
}

}  // namespace proofmass::test
