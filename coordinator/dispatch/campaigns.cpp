#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "coordinator/dispatch/detail.hpp"
#include "coordinator/dispatch/events.hpp"
#include "core/error.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

/// With one crash more a run is given up.
std::uint32_t num_crashes_before_last(const State& state) {
  return std::max(state.config.crashes_per_run_max, 2U) - 1;
}

/// Open runs that were blamed for crashes are suspects again. On which hosts is not known any more,
/// so that one more crash at least, here, must speak against them.
void restore_blame(State& state, CampaignId id, const StoredCampaign& stored, RunSet& open,
                   Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  for (const BlamedRun& blamed : stored.blamed) {
    if (blamed.num_crashes == 0 || !open.remove(blamed.run)) continue;
    campaign.suspects[blamed.run].num_crashes =
        std::min(num_crashes_before_last(state), blamed.num_crashes);
    detail::make_pending(state, id, RunSet(RunRange{blamed.run, 1}), detail::after(blamed.attempt),
                         outbox);
  }
}

/// Who computed the finished runs is not known any more: any worker may compute them again.
void restore_audits(CampaignState& campaign, const StoredCampaign& stored) {
  if (stored.control.phase == Phase::finished || stored.control.audit_fraction <= 0.0) return;
  RunSet left(stored.finished);
  left.remove(RunSet(stored.compared));
  RunSet to_audit;
  for (const RunRange& range : left.ranges()) {
    for (RunIndex run = range.first; run.value < range.end(); ++run.value) {
      if (is_audited(stored.definition->seed, run, stored.control.audit_fraction))
        to_audit.add({run, 1});
    }
  }
  constexpr AuditKey unknown{.first_worker = {0}, .attempt = {2}};
  if (!to_audit.empty()) detail::add_to_audit(campaign, unknown, to_audit);
}

/// Takes back all leases of a campaign. Where one that was the first for its runs ends while copies
/// remain, another first one is opened behind it.
void recall(State& state, CampaignId id, Outbox& outbox) {
  for (auto next = state.leases.begin(); next != state.leases.end();) {
    const LeaseId lease = next->first;
    if (next->second.campaign == id) {
      const RunSet runs = next->second.remaining;
      for (const RunRange& range : runs.ranges()) detail::note_unleased(state, lease, range);
      detail::lose(state, lease, runs, LossReason::retracted, {}, outbox);
    }
    next = state.leases.upper_bound(lease);
  }
}

}  // namespace

void on_campaign(State& state, CampaignId id, const StoredCampaign& stored, TimePoint now,
                 Outbox& outbox) {
  PROOFMASS_EXPECT(!state.campaigns.contains(id));
  state.ended.erase(id);
  CampaignState& campaign = state.campaigns[id];
  state.order.push_back(id);
  campaign.definition = stored.definition;
  campaign.num_audited = stored.num_audited;
  campaign.num_mismatches = stored.num_mismatches;
  campaign.model = {.version = std::string(stored.definition->model().version()),
                    .reference_digest = stored.reference_digest != 0
                                            ? stored.reference_digest
                                            : state.config.reference_digest,
                    .description_digest = stored.definition->model().description_digest()};
  campaign.phase = stored.control.phase;
  campaign.priority = stored.control.priority;
  campaign.audit_fraction = stored.control.audit_fraction;
  campaign.committed = RunSet(stored.finished);
  campaign.given_up = RunSet(stored.given_up);
  RunSet open(RunRange{{0}, stored.definition->num_runs});
  open.remove(campaign.committed);
  open.remove(campaign.given_up);
  campaign.elsewhere = open.overlap(RunSet(stored.elsewhere));
  open.remove(campaign.elsewhere);
  restore_blame(state, id, stored, open, outbox);
  detail::make_pending(state, id, std::move(open), {1}, outbox);
  restore_audits(campaign, stored);
  if (campaign.phase == Phase::finished && !is_finished(campaign)) campaign.phase = Phase::active;
  detail::adopt_set_aside(state, id, now);
  detail::sort_served(state);
  detail::settle(state, now, outbox);
}

void on_extended(State& state, CampaignId id, std::shared_ptr<const Campaign> definition,
                 TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  const std::uint64_t num_before = campaign.definition->num_runs;
  PROOFMASS_EXPECT(definition->num_runs > num_before);
  const RunRange added{{num_before}, definition->num_runs - num_before};
  campaign.definition = std::move(definition);
  if (campaign.phase == Phase::finished) campaign.phase = Phase::active;
  detail::make_pending(state, id, RunSet(added), {1}, outbox);
  detail::adopt_set_aside(state, id, now);
  detail::sort_served(state);
  detail::lend_to_hungry(state, now, outbox);
}

void on_control(State& state, CampaignId id, int priority, double audit_fraction) {
  CampaignState& campaign = state.campaigns.at(id);
  campaign.priority = priority;
  campaign.audit_fraction = audit_fraction;
  detail::sort_served(state);
}

void on_retry(State& state, CampaignId id, TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  const RunSet runs = std::exchange(campaign.given_up, {});
  for (const RunIndex run : indices_of(runs.ranges())) {
    campaign.suspects[run].num_crashes = num_crashes_before_last(state);
  }
  detail::make_pending(state, id, runs, {1}, outbox);
  if (campaign.phase == Phase::finished && !runs.empty()) campaign.phase = Phase::active;
  outbox.log(Event::info("given_up_runs_retried", {{"runs", runs.size()}}), id);
  detail::sort_served(state);
  detail::settle(state, now, outbox);
}

void on_pause(State& state, CampaignId id, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (campaign.phase != Phase::active) return;
  campaign.phase = Phase::paused;
  detail::sort_served(state);
  detail::RunsByWorker runs;
  for (auto& [lease_id, lease] : state.leases) {
    if (lease.campaign != id) continue;
    lease.is_retracted = true;
    runs[lease.worker].add(lease.remaining);
  }
  for (const auto& [worker, held] : runs) detail::send_retract(worker, id, held, outbox);
}

void on_resume(State& state, CampaignId id, TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (campaign.phase != Phase::paused && campaign.phase != Phase::cancelled) return;
  campaign.phase = Phase::active;
  for (auto& [lease_id, lease] : state.leases) {
    if (lease.campaign == id) lease.is_retracted = false;
  }
  detail::sort_served(state);
  detail::settle(state, now, outbox);
}

void on_cancel(State& state, CampaignId id, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (has_ended(campaign.phase)) return;
  campaign.phase = Phase::cancelled;
  detail::sort_served(state);
  recall(state, id, outbox);
  detail::send_not_served(state, id, outbox);
}

void on_removed(State& state, CampaignId id, Outbox& outbox) {
  const CampaignState& campaign = state.campaigns.at(id);
  PROOFMASS_EXPECT(campaign.delivered.empty());
  recall(state, id, outbox);
  if (has_ended(campaign.phase)) state.ended[id] = campaign.definition->num_runs;
  state.campaigns.erase(id);
  std::erase(state.order, id);
  std::erase(state.served, id);
  for (auto& [session, runs] : state.lent_before) runs.erase(id);
  for (auto& [host_id, host] : state.hosts) host.step_time_s.erase(id);
  for (auto& [worker_id, worker] : state.workers) {
    worker.run_time_s.erase(id);
    worker.card_work.erase(id);
    worker.unleased.erase(id);
    worker.joined.erase(id);
    std::erase_if(worker.computing,
                  [&](const Progress& progress) { return progress.campaign == id; });
  }
  detail::send_not_served(state, id, outbox);
}

void on_ended(State& state, CampaignId id, std::uint64_t num_runs) {
  PROOFMASS_EXPECT(!state.campaigns.contains(id));
  state.ended[id] = num_runs;
}

void on_unlisted(State& state, CampaignId id) {
  PROOFMASS_EXPECT(!state.campaigns.contains(id));
  state.ended.erase(id);
}

}  // namespace proofmass::coordinator
