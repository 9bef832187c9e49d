#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "coordinator/dispatch/detail.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator::detail {
namespace {

using HeldByAttempt = std::map<Attempt, RunSet>;

/// More than a worker can hold by the rules, so that one that claims everything gets it not.
constexpr std::uint64_t num_adopted_max = wire::runs_held_max;

RunSet all_of(const HeldByAttempt& held) {
  RunSet all;
  for (const auto& [attempt, runs] : held) all.add(runs);
  return all;
}

/// Runs of one campaign that one worker holds although they are not lent to it.
struct Adoption {
  State& state;
  WorkerId id;
  CampaignId campaign_id;
  TimePoint now;

  /// The part of `runs` that was lent to the worker before. What was lent before this coordinator
  /// started is not known by runs.
  [[nodiscard]] RunSet claimable(const RunSet& runs) const {
    const SessionId session = state.workers.at(id).session;
    if (state.attached.contains(session)) return runs;
    const auto found = state.lent_before.find(session);
    if (found == state.lent_before.end()) return {};
    const auto before = found->second.find(campaign_id);
    return before == found->second.end() ? RunSet() : before->second.overlap(runs);
  }

  /// Lends the worker from now on those runs that are pending and were lent to it before.
  void adopt(Attempt held_as, const RunSet& claimed) const {
    const RunSet runs = claimable(claimed);
    auto& pending = state.campaigns.at(campaign_id).pending;
    for (auto next = pending.begin(); next != pending.end();) {
      const Attempt attempt = next->first;
      const RunSet common = next->second.overlap(runs);
      if (!has_room_for(common)) {
        ++next;
        continue;
      }
      next->second.remove(common);
      next = next->second.empty() ? pending.erase(next) : std::next(next);
      open(held_as, attempt, common);
    }
  }

  /// A suspect that is all that the worker has goes on there if it might be lent to it, and counts
  /// as lent. Any other one must be tried alone.
  /// @return True if the only run is a suspect, and lent to the worker from now on.
  [[nodiscard]] bool adopt_suspect(const HeldByAttempt& held, const RunSet& rest) const {
    CampaignState& campaign = state.campaigns.at(campaign_id);
    auto& suspects = campaign.pending_suspects;
    const Worker& worker = state.workers.at(id);
    if (rest.size() != 1 || worker.num_lent > 0 || claimable(rest).empty()) return false;
    const auto found = suspects.find(rest.first());
    if (found == suspects.end()) return false;
    Suspicion& suspicion = campaign.suspects.at(found->first);
    if (!may_try(state, suspicion, worker)) return false;
    note_lent_alone(suspicion, worker, now);
    const auto held_as = std::find_if(held.begin(), held.end(), [&](const auto& item) {
      return item.second.contains(found->first);
    });
    const Attempt attempt = found->second;
    suspects.erase(found);
    open(held_as->first, attempt, rest, true);
    return true;
  }

 private:
  [[nodiscard]] bool has_room_for(const RunSet& runs) const {
    return !runs.empty() && state.workers.at(id).num_lent + runs.size() <= num_adopted_max;
  }

  void open(Attempt held_as, Attempt pending_as, const RunSet& runs, bool is_alone = false) const {
    const bool is_paused = state.campaigns.at(campaign_id).phase == Phase::paused;
    (void)open_lease(state, {.campaign = campaign_id,
                             .worker = id,
                             .attempt = std::max(held_as, pending_as),
                             .known_as = held_as,
                             .is_alone = is_alone,
                             .is_retracted = is_paused,
                             .is_adopted = true,
                             .remaining = runs,
                             .lent_at = now});
  }
};

/// Without those that the worker has delivered: the acknowledgement will come.
RunSet without_delivered(const CampaignState& campaign, RunSet runs) {
  for (const RunRange& range : runs.ranges()) {
    auto next = campaign.delivered.lower_bound(range.first);
    for (; next != campaign.delivered.end() && next->first.value < range.end(); ++next) {
      runs.remove(next->first);
    }
  }
  return runs;
}

/// Adopts what the worker holds and is not lent to anybody, and asks the rest back.
void settle_surplus(State& state, WorkerId id, CampaignId campaign_id, const HeldByAttempt& held,
                    TimePoint now, Outbox& outbox) {
  Worker& worker = state.workers.at(id);
  const CampaignState& campaign = state.campaigns.at(campaign_id);
  const RunSet leased = leased_runs(state, worker, campaign_id);
  const Adoption adoption{state, id, campaign_id, now};
  for (const auto& [attempt, runs] : held) {
    RunSet surplus = runs;
    surplus.remove(leased);
    if (!surplus.empty()) adoption.adopt(attempt, surplus);
  }
  RunSet rest = all_of(held);
  rest.remove(leased_runs(state, worker, campaign_id));
  rest = without_delivered(campaign, std::move(rest));
  RunSet open = rest;
  open.remove(campaign.committed);
  if (adoption.adopt_suspect(held, open)) {
    rest.remove(open);
    open = {};
  }
  if (!rest.empty()) send_retract(id, campaign_id, rest, outbox);
  if (!open.empty()) worker.unleased[campaign_id].add(open);
}

/// Number of runs of a campaign that is loaded or known as ended.
std::optional<std::uint64_t> num_runs_of(const State& state, CampaignId id) {
  const auto campaign = state.campaigns.find(id);
  if (campaign != state.campaigns.end()) return campaign->second.definition->num_runs;
  const auto ended = state.ended.find(id);
  return ended == state.ended.end() ? std::nullopt : std::optional(ended->second);
}

/// Takes out the runs that the campaign does not have: the worker keeps their results.
void settle_foreign(State& state, WorkerId id, CampaignId campaign_id, HeldByAttempt& held,
                    Outbox& outbox) {
  const std::optional<std::uint64_t> num_runs = num_runs_of(state, campaign_id);
  if (!num_runs) return;
  const RunRange known{{0}, *num_runs};
  RunSet foreign = all_of(held);
  foreign.remove(known);
  if (foreign.empty()) return;
  for (auto& [attempt, runs] : held) runs.remove(foreign);
  std::erase_if(held, [](const auto& item) { return item.second.empty(); });
  send_not_served(id, campaign_id, foreign.ranges(), outbox);
  state.workers.at(id).unleased[campaign_id] = std::move(foreign);
}

/// Runs that the worker was lent long ago and does not hold have not arrived, unless its heartbeat
/// has waited here to be read and is older than the lease.
void settle_missing(State& state, WorkerId id, const std::map<CampaignId, RunSet>& held,
                    TimePoint now, Outbox& outbox) {
  if (state.is_behind) return;
  const std::set<LeaseId> leases = state.workers.at(id).leases;
  for (const LeaseId lease_id : leases) {
    const auto lease_found = state.leases.find(lease_id);
    if (lease_found == state.leases.end()) continue;  // It ended with one before it.
    const Lease& lease = lease_found->second;
    if (now - lease.lent_at < state.config.arrival_max) continue;
    RunSet missing = lease.remaining;
    const auto found = held.find(lease.campaign);
    if (found != held.end()) missing.remove(found->second);
    if (!missing.empty()) lose(state, lease_id, missing, LossReason::never_arrived, {}, outbox);
  }
}

/// Asks again for what the worker should give back.
void repeat_retracts(const State& state, WorkerId id, Outbox& outbox) {
  const Worker& worker = state.workers.at(id);
  RunsByCampaign runs;
  for (const LeaseId lease_id : worker.leases) {
    const Lease& lease = state.leases.at(lease_id);
    if (lease.is_retracted) runs[lease.campaign].add(lease.remaining);
  }
  for (auto& [campaign, waiting] : runs) {
    for (const Progress& progress : worker.computing) {
      if (progress.campaign == campaign) waiting.remove(progress.runs);
    }
    if (!waiting.empty()) send_retract(id, campaign, waiting, outbox);
  }
}

bool is_wanted(const State& state, CampaignId id) {
  const auto found = state.campaigns.find(id);
  return found != state.campaigns.end() && !has_ended(found->second.phase);
}

/// Runs of one campaign that the worker holds.
void settle_held(State& state, WorkerId id, CampaignId campaign, HeldByAttempt held, TimePoint now,
                 Outbox& outbox) {
  settle_foreign(state, id, campaign, held, outbox);
  if (held.empty()) return;
  if (is_wanted(state, campaign)) {
    settle_surplus(state, id, campaign, held, now, outbox);
  } else {
    send_not_served(state, id, campaign, outbox);
    state.workers.at(id).unleased[campaign].add(all_of(held));
  }
}

/// Runs of one campaign whose results the worker could not deliver. If the campaign is served now,
/// they are lent to it: it will deliver them, and nobody else needs to compute them.
void settle_set_aside(State& state, WorkerId id, CampaignId campaign_id, TimePoint now,
                      Outbox& outbox) {
  if (is_wanted(state, campaign_id)) {
    const Adoption adoption{state, id, campaign_id, now};
    const auto& set_aside = state.workers.at(id).set_aside.at(campaign_id);
    for (const auto& [attempt, runs] : set_aside) adoption.adopt(attempt, runs);
  } else if (state.campaigns.contains(campaign_id) || state.ended.contains(campaign_id)) {
    send_not_served(state, id, campaign_id, outbox);
  }
}

/// The batch has advanced from `before`, now.
void add_step_time(State& state, const HostId& host, const Progress& before,
                   const Progress& batch) {
  if (!state.campaigns.contains(batch.campaign)) return;
  double& step_time_s = state.hosts.at(host).step_time_s[batch.campaign];
  const double time_s = seconds(batch.advanced_at - before.advanced_at) /
                        static_cast<double>(batch.num_steps_done - before.num_steps_done);
  step_time_s = running_mean(step_time_s, time_s);
}

/// How long a batch may take for a step, by what this host has shown: others may say anything.
/// Before anything is known, as if a step usually took a tenth of what is waited at least; a run
/// takes longer than any of its steps. A model program is ended by its worker if it takes longer
/// than it may.
Duration patience(const State& state, const Worker& worker, CampaignId id) {
  const auto campaign = state.campaigns.find(id);
  const bool is_of_program =
      campaign != state.campaigns.end() && campaign->second.model.description_digest != 0;
  if (is_of_program) return Duration::max();
  const DispatchConfig& config = state.config;
  const std::map<CampaignId, double>& steps = state.hosts.at(worker.host).step_time_s;
  double step_time_s = 0.1 * seconds(config.hung_after_min);
  const auto run = worker.run_time_s.find(id);
  if (run != worker.run_time_s.end()) step_time_s = run->second;
  const auto step = steps.find(id);
  if (step != steps.end()) step_time_s = step->second;
  return std::max(config.hung_after_min, bounded_duration(config.hung_after_steps * step_time_s));
}

}  // namespace

void reconcile(State& state, WorkerId id, const proto::Heartbeat& heartbeat, TimePoint now,
               Outbox& outbox) {
  RunsByCampaign all_held;
  const auto add = [&](const auto& listed, std::map<CampaignId, HeldByAttempt>& held) {
    for (const proto::HeldRuns& item : listed) {
      const RunSet runs(wire::ranges_of(item.ranges()));
      held[{item.campaign()}][{item.attempt()}].add(runs);
      all_held[{item.campaign()}].add(runs);
    }
  };
  std::map<CampaignId, HeldByAttempt> held;
  add(heartbeat.held(), held);
  Worker& worker = state.workers.at(id);
  worker.unleased.clear();
  worker.set_aside.clear();
  add(heartbeat.set_aside(), worker.set_aside);
  for (auto& [campaign, runs] : held) {
    settle_held(state, id, campaign, std::move(runs), now, outbox);
  }
  for (const auto& [campaign, runs] : worker.set_aside) {
    settle_set_aside(state, id, campaign, now, outbox);
  }
  settle_missing(state, id, all_held, now, outbox);
  repeat_retracts(state, id, outbox);
}

void adopt_set_aside(State& state, CampaignId campaign, TimePoint now) {
  if (!is_wanted(state, campaign)) return;
  for (const auto& [id, worker] : state.workers) {
    const auto found = worker.set_aside.find(campaign);
    if (found == worker.set_aside.end()) continue;
    const Adoption adoption{state, id, campaign, now};
    for (const auto& [attempt, runs] : found->second) adoption.adopt(attempt, runs);
  }
}

void note_progress(State& state, Worker& worker, const proto::Heartbeat& heartbeat, TimePoint now) {
  // After a silence the process, or the machine, may have slept: nothing is held against it.
  const bool was_silent = now - worker.heartbeat_at >= state.config.suspect_after;
  worker.heartbeat_at = now;
  worker.num_steps_done = heartbeat.num_steps_done();
  std::vector<Progress> computing;
  for (const proto::ComputedBatch& message : heartbeat.computing()) {
    Progress batch{.campaign = {message.campaign()},
                   .runs = RunSet(wire::ranges_of(message.ranges())),
                   .num_steps_done = message.num_steps_done(),
                   .advanced_at = now};
    const auto before = std::ranges::find_if(worker.computing, [&](const Progress& known) {
      return known.campaign == batch.campaign && known.runs == batch.runs;
    });
    if (before != worker.computing.end() && !was_silent) {
      if (batch.num_steps_done > before->num_steps_done) {
        add_step_time(state, worker.host, *before, batch);
      } else {
        batch.advanced_at = before->advanced_at;
      }
    }
    computing.push_back(std::move(batch));
  }
  worker.computing = std::move(computing);
}

const Progress* hung_batch(const State& state, const Worker& worker, TimePoint now) {
  // Only heartbeats tell how far batches are: without them nothing is known, whatever else arrives.
  if (now - worker.heartbeat_at >= state.config.suspect_after) return nullptr;
  for (const Progress& progress : worker.computing) {
    if (now - progress.advanced_at >= patience(state, worker, progress.campaign)) return &progress;
  }
  return nullptr;
}

}  // namespace proofmass::coordinator::detail
