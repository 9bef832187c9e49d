#include "worker/net/held_runs.hpp"

#include <algorithm>

namespace proofmass::worker {

std::vector<wire::HeldRuns> grouped(std::vector<HeldRun> runs, std::size_t num_ranges_max) {
  std::sort(runs.begin(), runs.end());
  std::vector<wire::HeldRuns> groups;
  std::size_t num_ranges = 0;
  for (const HeldRun& held : runs) {
    const bool is_of_last = !groups.empty() && groups.back().campaign == held.campaign &&
                            groups.back().attempt == held.attempt;
    const bool is_in_last = is_of_last && groups.back().ranges.back().end() == held.run.value;
    if (!is_in_last && num_ranges++ == num_ranges_max) break;
    if (!is_of_last) groups.push_back({held.campaign, held.attempt, {}});
    append(groups.back().ranges, held.run);
  }
  return groups;
}

std::size_t num_ranges(const std::vector<wire::HeldRuns>& held) {
  std::size_t count = 0;
  for (const wire::HeldRuns& runs : held) count += runs.ranges.size();
  return count;
}

void UnacknowledgedResults::add(wire::LeasedResult result, TimePoint due_at) {
  const RunKey key{result.campaign, result.computed.result.run};
  results_[key] = {.attempt = result.attempt,
                   .computed = std::move(result.computed),
                   .due_at = due_at,
                   .resend_after = resend_after_};
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

std::vector<wire::ResultBatch> UnacknowledgedResults::take_due(TimePoint now) {
  std::vector<RunKey> runs;
  for (const auto& [key, kept] : results_) {
    if (runs.size() == wire::runs_per_lease_max) break;
    if (kept.due_at <= now) runs.push_back(key);
  }
  return take(runs, now);
}

std::vector<wire::ResultBatch> UnacknowledgedResults::take(std::span<const RunKey> runs,
                                                           TimePoint now) {
  std::vector<wire::ResultBatch> full;
  std::map<std::pair<wire::CampaignId, wire::Attempt>, wire::ResultBatch> batches;
  for (const RunKey& run : runs) {
    Kept& kept = results_.at(run);
    wire::ResultBatch& batch = batches[{run.first, kept.attempt}];
    batch.campaign = run.first;
    batch.attempt = kept.attempt;
    batch.results.push_back(kept.computed);
    kept.due_at = now + kept.resend_after;
    kept.resend_after = std::min(2 * kept.resend_after, resend_after_max_);
    if (batch.results.size() < wire::runs_per_lease_max) continue;
    full.push_back(std::move(batch));
    batches.erase({run.first, kept.attempt});
  }
  for (auto& [key, batch] : batches) full.push_back(std::move(batch));
  return full;
}

std::vector<wire::LeasedResult> UnacknowledgedResults::all() const {
  std::vector<wire::LeasedResult> results;
  for (const auto& [key, kept] : results_) {
    results.push_back({key.first, kept.attempt, kept.computed});
  }
  return results;
}

void UnacknowledgedResults::list(std::vector<HeldRun>& held,
                                 std::vector<HeldRun>& set_aside) const {
  for (const auto& [key, kept] : results_) {
    (kept.is_set_aside ? set_aside : held).push_back({key.first, kept.attempt, key.second});
  }
}

}  // namespace proofmass::worker
