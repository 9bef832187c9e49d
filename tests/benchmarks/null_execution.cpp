#include "tests/benchmarks/null_execution.hpp"

#include <array>
#include <utility>

#include "core/runs.hpp"
#include "tests/benchmarks/null_result.hpp"

namespace proofmass::test {

void NullExecution::define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) {
  seeds_[campaign] = definition->seed;
  const auto waiting = waiting_.extract(campaign);
  if (waiting.empty()) return;
  for (const RunIndex run : waiting.mapped()) finish(campaign, run);
}

void NullExecution::submit(wire::RunLease lease) {
  for (const RunIndex run : indices_of(std::array{lease.runs})) {
    if (is_defined(lease.campaign)) {
      finish(lease.campaign, run);
    } else {
      waiting_[lease.campaign].insert(run);
    }
  }
}

std::vector<RunIndex> NullExecution::drop_waiting(wire::CampaignId campaign,
                                                  std::span<const RunRange> ranges) {
  std::vector<RunIndex> dropped;
  const auto waiting = waiting_.find(campaign);
  if (waiting == waiting_.end()) return dropped;
  for (const RunIndex run : indices_of(ranges)) {
    if (waiting->second.erase(run) > 0) dropped.push_back(run);
  }
  return dropped;
}

void NullExecution::forget(wire::CampaignId campaign) {
  waiting_.erase(campaign);
  seeds_.erase(campaign);
  std::erase_if(finished_, [&](const auto& run) { return run.campaign == campaign; });
}

std::vector<worker::FinishedRun> NullExecution::take_finished() {
  return std::exchange(finished_, {});
}

void NullExecution::finish(wire::CampaignId campaign, RunIndex run) {
  finished_.push_back(
      {.campaign = campaign,
       .computed = {.result = null_result(seeds_.at(campaign), run), .elapsed_s = elapsed_s_}});
}

}  // namespace proofmass::test
