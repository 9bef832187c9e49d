#include "tests/system/simulated_network_execution.hpp"

#include <algorithm>

#include "core/runs.hpp"
#include "proto/proofmass.pb.h"
#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

constexpr std::uint32_t num_steps = 3;  // Of a run.

bool is_in(std::span<const RunRange> ranges, RunIndex run) {
  return std::any_of(ranges.begin(), ranges.end(), [&](const RunRange& range) {
    return run >= range.first && run.value < range.end();
  });
}

std::vector<RunRange> ranges_of(const std::vector<RunKey>& runs) {
  std::vector<RunRange> ranges;
  for (const auto& [campaign, run] : runs) {
    if (!ranges.empty() && ranges.back().end() == run.value) {
      ++ranges.back().count;
    } else {
      ranges.push_back({run, 1});
    }
  }
  return ranges;
}

}  // namespace

PlayedExecution::PlayedExecution(const Poison& poison, const Draws& draws, std::size_t num_threads,
                                 std::size_t num_lanes, bool has_cards)
    : poison_(poison),
      draws_(draws),
      num_threads_(num_threads),
      num_lanes_(num_lanes),
      has_cards_(has_cards) {}

void PlayedExecution::define(wire::CampaignId campaign, std::shared_ptr<const Campaign>) {
  defined_.insert(campaign);
}

void PlayedExecution::submit(const proto::RunLease& lease, std::span<const RunRange> runs) {
  for (const RunIndex run : indices_of(runs)) {
    waiting_.push_back({{{lease.campaign()}, run}, lease.is_alone(), lease.is_for_cards()});
  }
}

std::vector<RunIndex> PlayedExecution::drop_waiting(wire::CampaignId campaign,
                                                    std::span<const RunRange> ranges) {
  std::vector<RunIndex> dropped;
  std::erase_if(waiting_, [&](const WaitingRun& waiting) {
    const auto& [run_campaign, run] = waiting.run;
    if (run_campaign != campaign || !is_in(ranges, run)) return false;
    dropped.push_back(run);
    return true;
  });
  std::sort(dropped.begin(), dropped.end());
  return dropped;
}

bool PlayedExecution::drop_batch(std::uint64_t number) {
  return std::erase_if(batches_, [&](const Batch& batch) { return batch.number == number; }) > 0;
}

void PlayedExecution::forget(wire::CampaignId campaign) {
  std::erase_if(waiting_, [&](const WaitingRun& run) { return run.run.first == campaign; });
  std::erase_if(batches_, [&](const Batch& batch) { return batch.runs[0].first == campaign; });
  std::erase_if(finished_, [&](const auto& finished) { return finished.campaign == campaign; });
  std::erase_if(crashed_, [&](const auto& crashed) { return crashed.campaign == campaign; });
  defined_.erase(campaign);
}

void PlayedExecution::abandon() {
  waiting_.clear();
  batches_.clear();
}

std::vector<worker::RunningBatch> PlayedExecution::computing() const {
  std::vector<worker::RunningBatch> computing;
  for (const Batch& batch : batches_) {
    computing.push_back({.number = batch.number,
                         .campaign = batch.runs[0].first,
                         .ranges = ranges_of(batch.runs),
                         .num_steps_done = batch.num_steps_done,
                         .time_left = std::nullopt});
  }
  return computing;
}

std::optional<PlayedExecution::Batch> PlayedExecution::next_batch() {
  Batch batch{.number = next_batch_, .runs = {}};
  for (auto next = waiting_.begin(); next != waiting_.end() && batch.runs.size() < num_lanes_;) {
    const bool is_first = batch.runs.empty();
    const bool fits = is_first ? defined_.contains(next->run.first)
                               : !next->is_alone && next->run.first == batch.runs[0].first &&
                                     (has_cards_ && next->is_for_cards) == batch.is_by_card;
    if (!fits) {
      ++next;
      continue;
    }
    const bool is_alone = next->is_alone;
    batch.is_by_card = has_cards_ && next->is_for_cards;
    batch.runs.push_back(next->run);
    next = waiting_.erase(next);
    if (is_alone) break;
  }
  if (batch.runs.empty()) return std::nullopt;
  std::sort(batch.runs.begin(), batch.runs.end());
  ++next_batch_;
  return batch;
}

PlayedExecution::Outcome PlayedExecution::advance() {
  const auto is_any_of = [](const Batch& batch, const std::set<RunKey>& runs) {
    return std::any_of(batch.runs.begin(), batch.runs.end(),
                       [&](const RunKey& run) { return runs.contains(run); });
  };
  Outcome outcome = Outcome::nothing;
  for (auto batch = batches_.begin(); batch != batches_.end();) {
    if (is_any_of(*batch, poison_.crashing)) return Outcome::crashed;
    if (is_any_of(*batch, poison_.crashing_outside)) {
      worker::CrashedBatch& crashed = crashed_.emplace_back();
      crashed.campaign = batch->runs[0].first;
      for (const RunKey& run : batch->runs) crashed.runs.push_back(run.second);
      outcome = Outcome::finished;
      batch = batches_.erase(batch);
      continue;
    }
    if (!is_any_of(*batch, poison_.hanging)) {
      ++batch->num_steps_done;
      num_steps_done_ += batch->runs.size();
    }
    if (batch->num_steps_done < num_steps) {
      ++batch;
      continue;
    }
    for (const auto& [campaign, run] : batch->runs) {
      const RunDraw& draw = draws_.at({campaign, run});
      wire::ComputedRun computed{.result = zero_result({.run = run, .num_draws = draw.num_draws}),
                                 .elapsed_s = 0.7,
                                 .is_by_card = batch->is_by_card};
      computed.result.truth = draw.truth;
      finished_.push_back({.campaign = campaign, .attempt = {}, .computed = computed});
    }
    outcome = Outcome::finished;
    batch = batches_.erase(batch);
  }
  while (batches_.size() < num_threads_) {
    auto batch = next_batch();
    if (!batch) break;
    batches_.push_back(*std::move(batch));
  }
  return outcome;
}

}  // namespace proofmass::test
