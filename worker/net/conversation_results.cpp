#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/error.hpp"
#include "worker/net/conversation.hpp"

// What becomes of results: they are kept, and sent again and again, until the coordinator says that
// they are stored, or that nobody needs them.

namespace proofmass::worker {

void Conversation::restore(std::vector<wire::LeasedResult> results) {
  for (wire::LeasedResult& result : results) {
    const RunKey key{result.campaign, result.computed.result.run};
    unacknowledged_[key] = {.attempt = result.attempt,
                            .computed = result.computed,
                            .due_at = TimePoint::min(),
                            .resend_after = config_.resend_after};
  }
}

std::vector<wire::LeasedResult> Conversation::unacknowledged() const {
  std::vector<wire::LeasedResult> results;
  for (const auto& [key, sent] : unacknowledged_) {
    results.push_back({key.first, sent.attempt, sent.computed});
  }
  return results;
}

/// One that was taken, or is not wanted any more.
void Conversation::drop_result(std::map<RunKey, SentResult>::iterator result) {
  if (result->second.is_set_aside) --num_set_aside_;
  unacknowledged_.erase(result);
}

std::size_t Conversation::drop_results(wire::CampaignId campaign, RunRange runs) {
  std::size_t count = 0;
  auto next = unacknowledged_.lower_bound({campaign, runs.first});
  while (next != unacknowledged_.end() && next->first < RunKey{campaign, RunIndex{runs.end()}}) {
    drop_result(next++);
    ++count;
  }
  return count;
}

/// The coordinator cannot take these results now. They are offered again when they are due, ever
/// more seldom.
void Conversation::set_aside(wire::CampaignId campaign, std::span<const RunRange> ranges) {
  std::size_t count = 0;
  for (const RunRange& range : ranges) {
    const RunKey end{campaign, RunIndex{range.end()}};
    auto next = unacknowledged_.lower_bound({campaign, range.first});
    for (; next != unacknowledged_.end() && next->first < end; ++next) {
      if (!std::exchange(next->second.is_set_aside, true)) ++count;
    }
  }
  num_set_aside_ += count;
  if (count == 0) return;
  note({.severity = wire::Severity::warning,
        .kind = "results_set_aside",
        .fields = {{"campaign", fmt::format("{:016x}", campaign.value)},
                   {"results", count},
                   wire::Field::remark("(not served now)")}});
}

std::vector<Conversation::RunKey> Conversation::keep_finished(TimePoint now) {
  std::vector<RunKey> runs;
  for (FinishedRun& finished : execution_.take_finished()) {
    const RunKey key{finished.campaign, finished.computed.result.run};
    const auto found = unfinished_.find(key);
    PROOFMASS_EXPECT(found != unfinished_.end());
    unacknowledged_[key] = {.attempt = found->second,
                            .computed = finished.computed,
                            .due_at = now,
                            .resend_after = config_.resend_after};
    unfinished_.erase(found);
    runs.push_back(key);
  }
  return runs;
}

void Conversation::repeat_results(TimePoint now) {
  for (auto& [key, result] : unacknowledged_) {
    result.due_at = now;
    result.resend_after = config_.resend_after;
  }
  send_due_results(now);
}

/// As many as one message may have; the next tick has the others.
void Conversation::send_due_results(TimePoint now) {
  std::vector<RunKey> runs;
  for (const auto& [key, result] : unacknowledged_) {
    if (runs.size() == wire::runs_per_lease_max) break;
    if (result.due_at <= now) runs.push_back(key);
  }
  send_results(runs, now);
}

/// @pre All of them are kept.
void Conversation::send_results(std::span<const RunKey> runs, TimePoint now) {
  std::map<std::pair<wire::CampaignId, wire::Attempt>, wire::ResultBatch> batches;
  for (const RunKey& run : runs) {
    SentResult& result = unacknowledged_.at(run);
    wire::ResultBatch& batch = batches[{run.first, result.attempt}];
    batch.campaign = run.first;
    batch.attempt = result.attempt;
    batch.results.push_back(result.computed);
    result.due_at = now + result.resend_after;
    result.resend_after = std::min(2 * result.resend_after, config_.resend_after_max);
    if (batch.results.size() == wire::runs_per_lease_max) {
      send(std::exchange(batch, {}));
      batches.erase({run.first, result.attempt});
    }
  }
  for (auto& [key, batch] : batches) send(std::move(batch));
}

}  // namespace proofmass::worker
