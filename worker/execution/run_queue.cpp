#include "worker/execution/run_queue.hpp"

#include <algorithm>
#include <utility>

#include "core/runs.hpp"
#include "proto/proofmass.pb.h"

namespace proofmass::worker {

void RunQueue::add(const proto::RunLease& lease, std::span<const RunRange> runs) {
  const int width = lease.table_values_size() / static_cast<int>(lease.num_runs());
  for (const RunIndex run : indices_of(runs)) {
    const auto position = static_cast<int>(run.value - lease.first_run());
    const auto values = lease.table_values().begin() + position * width;
    runs_.push_back({.campaign = {lease.campaign()},
                     .is_alone = lease.is_alone(),
                     .is_for_cards = lease.is_for_cards(),
                     .batch_runs_max = lease.batch_runs_max(),
                     .request = {.run = run, .table_values = {values, values + width}}});
  }
}

TakenRuns RunQueue::take(std::size_t count_max, const IsWanted& is_wanted) {
  TakenRuns assignment;
  assignment.campaign = first_campaign(is_wanted);
  for (auto run = runs_.begin(); run != runs_.end() && assignment.requests.size() < count_max;) {
    const bool can_join = assignment.requests.empty() || !run->is_alone;
    if (run->campaign != assignment.campaign || !can_join ||
        !is_wanted(run->campaign, run->is_for_cards)) {
      ++run;
      continue;
    }
    const bool is_alone = run->is_alone;
    if (assignment.requests.empty() && run->batch_runs_max > 0) {
      count_max = std::min<std::size_t>(count_max, run->batch_runs_max);
    }
    assignment.requests.push_back(std::move(run->request));
    run = runs_.erase(run);
    if (is_alone) break;
  }
  return assignment;
}

std::vector<RunIndex> RunQueue::drop(wire::CampaignId campaign, std::span<const RunRange> ranges) {
  const auto is_in_range = [&](RunIndex run) {
    return std::ranges::any_of(ranges, [&](const RunRange& range) {
      return range.first <= run && run.value < range.end();
    });
  };
  std::vector<RunIndex> dropped;
  runs_.remove_if([&](const Waiting& waiting) {
    if (waiting.campaign != campaign || !is_in_range(waiting.request.run)) return false;
    dropped.push_back(waiting.request.run);
    return true;
  });
  std::ranges::sort(dropped);
  return dropped;
}

void RunQueue::drop(wire::CampaignId campaign) {
  runs_.remove_if([&](const Waiting& waiting) { return waiting.campaign == campaign; });
}

bool RunQueue::has(wire::CampaignId campaign) const {
  return std::ranges::any_of(runs_, [&](const Waiting& run) { return run.campaign == campaign; });
}

wire::CampaignId RunQueue::first_campaign(const IsWanted& is_wanted) const {
  const auto found = std::ranges::find_if(
      runs_, [&](const Waiting& run) { return is_wanted(run.campaign, run.is_for_cards); });
  return found == runs_.end() ? wire::CampaignId{} : found->campaign;
}

}  // namespace proofmass::worker
