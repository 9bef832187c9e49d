#include "worker/net/held_runs.hpp"

#include <algorithm>

#include "proto/wire/codec.hpp"

namespace proofmass::worker {

HeldRunsList grouped(std::vector<HeldRun> runs, std::size_t num_ranges_max) {
  std::sort(runs.begin(), runs.end());
  HeldRunsList groups;
  proto::HeldRuns* group = nullptr;
  proto::Range* range = nullptr;
  std::size_t num_ranges = 0;
  for (const HeldRun& held : runs) {
    const bool is_of_group = group != nullptr && group->campaign() == held.campaign.value &&
                             group->attempt() == held.attempt.value;
    if (is_of_group && range->first() + range->count() == held.run.value) {
      range->set_count(range->count() + 1);
      continue;
    }
    if (num_ranges++ == num_ranges_max) break;
    if (!is_of_group) {
      group = groups.Add();
      group->set_campaign(held.campaign.value);
      group->set_attempt(held.attempt.value);
    }
    range = group->add_ranges();
    range->set_first(held.run.value);
    range->set_count(1);
  }
  return groups;
}

std::size_t num_ranges(const HeldRunsList& held) {
  std::size_t count = 0;
  for (const proto::HeldRuns& runs : held) count += static_cast<std::size_t>(runs.ranges_size());
  return count;
}

void UnacknowledgedResults::add(wire::LeasedResult result, TimePoint due_at) {
  const RunKey key{result.campaign, result.computed.result.run};
  results_[key] = {.result = std::move(result), .due_at = due_at, .resend_after = resend_after_};
}

UnacknowledgedResults::Results::iterator UnacknowledgedResults::drop(Results::iterator result) {
  if (result->second.is_set_aside) --num_set_aside_;
  return results_.erase(result);
}

void UnacknowledgedResults::drop(wire::CampaignId campaign, std::span<const RunIndex> runs) {
  for (const RunIndex run : runs) {
    const auto found = results_.find({campaign, run});
    if (found != results_.end()) drop(found);
  }
}

std::size_t UnacknowledgedResults::drop(wire::CampaignId campaign, RunRange runs) {
  std::size_t count = 0;
  const RunKey end{campaign, RunIndex{runs.end()}};
  auto next = results_.lower_bound({campaign, runs.first});
  for (; next != results_.end() && next->first < end; ++count) next = drop(next);
  return count;
}

std::size_t UnacknowledgedResults::set_aside(wire::CampaignId campaign,
                                             std::span<const RunRange> ranges) {
  std::size_t count = 0;
  for (const RunRange& range : ranges) {
    const RunKey end{campaign, RunIndex{range.end()}};
    auto next = results_.lower_bound({campaign, range.first});
    for (; next != results_.end() && next->first < end; ++next) {
      if (!std::exchange(next->second.is_set_aside, true)) ++count;
    }
  }
  num_set_aside_ += count;
  return count;
}

void UnacknowledgedResults::make_due(TimePoint now) {
  for (auto& [key, kept] : results_) {
    kept.due_at = now;
    kept.resend_after = resend_after_;
  }
}

std::vector<proto::ResultBatch> UnacknowledgedResults::take_due(TimePoint now) {
  std::vector<RunKey> runs;
  for (const auto& [key, kept] : results_) {
    if (runs.size() == wire::runs_per_lease_max) break;
    if (kept.due_at <= now) runs.push_back(key);
  }
  return take(runs, now);
}

std::vector<proto::ResultBatch> UnacknowledgedResults::take(std::span<const RunKey> runs,
                                                            TimePoint now) {
  wire::ResultBatches batches;
  for (const RunKey& run : runs) {
    Kept& kept = results_.at(run);
    batches.add(kept.result);
    kept.due_at = now + kept.resend_after;
    kept.resend_after = std::min(2 * kept.resend_after, resend_after_max_);
  }
  return batches.take();
}

std::vector<wire::LeasedResult> UnacknowledgedResults::all() const {
  std::vector<wire::LeasedResult> results;
  for (const auto& [key, kept] : results_) results.push_back(kept.result);
  return results;
}

void UnacknowledgedResults::list(std::vector<HeldRun>& held,
                                 std::vector<HeldRun>& set_aside) const {
  for (const auto& [key, kept] : results_) {
    (kept.is_set_aside ? set_aside : held).push_back({key.first, kept.result.attempt, key.second});
  }
}

}  // namespace proofmass::worker
