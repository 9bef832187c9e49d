#include <algorithm>
#include <utility>

#include "coordinator/dispatch/detail.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// Whether more than one run may be the cause.
enum class Certainty : std::uint8_t { ambiguous, certain };

/// The runs that the worker computed by its last heartbeat, as far as they are still on its leases.
/// If no heartbeat named any, the runs that it begins with.
RunsByCampaign computed_runs(const State& state, const Worker& worker) {
  RunsByCampaign computed;
  for (const Progress& progress : worker.computing) {
    const RunSet runs = leased_runs(state, worker, progress.campaign).overlap(progress.runs);
    if (!runs.empty()) computed[progress.campaign].add(runs);
  }
  if (!computed.empty()) return computed;
  std::uint64_t num_left = worker.num_slots;
  for (const LeaseId id : worker.leases) {
    const Lease& lease = state.leases.at(id);
    if (num_left == 0) break;
    RunSet remaining = lease.remaining;
    const RunSet begun = remaining.take_first(ratio_rounded_up(num_left, lease.slots_per_run));
    computed[lease.campaign].add(begun);
    num_left -= std::min(num_left, begun.size() * lease.slots_per_run);
  }
  return computed;
}

/// Takes back what crashes on this host count against runs: the host is the cause.
void withdraw(State& state, CampaignId id, const HostId& host) {
  CampaignState& campaign = state.campaigns.at(id);
  for (auto next = campaign.suspects.begin(); next != campaign.suspects.end();) {
    const auto current = next++;
    const auto crashes = current->second.hosts.find(host);
    if (crashes == current->second.hosts.end()) continue;
    current->second.num_crashes -= crashes->second.num_crashes;
    current->second.hosts.erase(crashes);
    if (current->second.num_crashes > 0) continue;
    const auto waiting = campaign.pending_suspects.find(current->first);
    if (waiting != campaign.pending_suspects.end()) {
      campaign.pending[waiting->second].add({waiting->first, 1});
      campaign.pending_suspects.erase(waiting);
    }
    campaign.suspects.erase(current);
  }
}

void quarantine(State& state, const HostId& host, std::uint32_t num_crashes, Outbox& outbox) {
  state.quarantined[host] = state.ticked_at + state.config.quarantine_duration;
  for (const auto& [id, campaign] : state.campaigns) withdraw(state, id, host);
  wire::Fields fields{{"host", state.hosts.at(host).name}, {"crashes", num_crashes}};
  if (!host.address.empty()) fields.emplace_back("address", host.address);
  if (!host.key.empty()) fields.emplace_back("key", host.key);
  outbox.log(Event::error("host_quarantined", std::move(fields)));
}

bool is_proven(const State& state, const HostId& id) {
  const auto host = state.hosts.find(id);
  return host != state.hosts.end() && host->second.num_results > 0;
}

/// Crashes of the run without those on hosts that have delivered nothing.
std::uint32_t num_credible(const State& state, const Suspicion& suspicion) {
  std::uint32_t count = suspicion.num_crashes;
  for (const auto& [host, on_host] : suspicion.hosts) {
    if (!is_proven(state, host)) count -= on_host.num_crashes;
  }
  return count;
}

/// The smaller, the sooner the host may try the run. A crash says more than a computation without a
/// result, which any worker can make up.
std::uint32_t share_of_run(const Suspicion& suspicion, const HostId& id) {
  const auto host = suspicion.hosts.find(id);
  return host == suspicion.hosts.end() ? 0
                                       : 4 * host->second.num_crashes + host->second.num_lent_alone;
}

/// A run that is stored cannot become a suspect. Its audit is given up instead.
void count_audit_crash(State& state, CampaignId id, RunIndex run, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  const std::uint32_t num_crashes = ++campaign.audit_crashes[run];
  if (num_crashes < state.config.crashes_per_run_max) return;
  take_off(state, *campaign.audits.find(run), {run, 1});
  campaign.audit_crashes.erase(run);
  outbox.log(Event::error("audit_given_up", {{"run", run.value}, {"crashes", num_crashes}}), id);
}

/// If several runs may be the cause, runs that are suspects already are left out: they will be
/// tried alone, and only then does a crash tell more about them.
RunSet blame_runs(CampaignState& campaign, const RunSet& accused, Certainty certainty,
                  const HostId& host, TimePoint now) {
  RunSet blamed;
  for (const RunIndex run : indices_of(accused.ranges())) {
    if (certainty == Certainty::ambiguous && campaign.suspects.contains(run)) continue;
    Suspicion& suspicion = campaign.suspects[run];
    Suspicion::OnHost& on_host = suspicion.hosts[host];
    suspicion.tried_at = now;
    ++suspicion.num_crashes;
    ++on_host.num_crashes;
    if (certainty == Certainty::certain) ++on_host.num_alone;
    blamed.add({run, 1});
  }
  return blamed;
}

/// Takes the audits out of the accused runs.
RunsByCampaign split_audits(const State& state, RunsByCampaign& accused) {
  RunsByCampaign audits;
  for (auto& [id, runs] : accused) {
    audits[id] = runs.overlap(state.campaigns.at(id).audits.runs());
    runs.remove(audits[id]);
  }
  std::erase_if(accused, [](const auto& item) { return item.second.empty(); });
  return audits;
}

RunsByCampaign blame_all(State& state, const HostId& host, RunsByCampaign accused,
                         Certainty certainty, Outbox& outbox) {
  const RunsByCampaign audits = split_audits(state, accused);
  RunsByCampaign blamed;
  for (const auto& [campaign, runs] : accused) {
    blamed[campaign] =
        blame_runs(state.campaigns.at(campaign), runs, certainty, host, state.ticked_at);
  }
  if (!accused.empty()) return blamed;
  for (const auto& [campaign, runs] : audits) {
    for (const RunIndex run : indices_of(runs.ranges())) {
      count_audit_crash(state, campaign, run, outbox);
    }
  }
  return blamed;
}

/// Counts a crash of a worker against its host, and then against the runs.
RunsByCampaign blame(State& state, WorkerId id, RunsByCampaign accused, Certainty certainty,
                     Outbox& outbox) {
  const HostId host = state.workers.at(id).host;
  // The end of a process that was lent nothing proves nothing: anybody can start and end one.
  if (state.quarantined.contains(host) || state.workers.at(id).num_lent == 0) return {};
  const std::uint32_t num_crashes = ++state.hosts.at(host).num_crashes;
  if (num_crashes >= state.config.crashes_per_host_max) {
    quarantine(state, host, num_crashes, outbox);
    return {};
  }
  return blame_all(state, host, std::move(accused), certainty, outbox);
}

Certainty certainty_of(const RunSet& runs) {
  return runs.size() == 1 ? Certainty::certain : Certainty::ambiguous;
}

}  // namespace

RunsByCampaign blame_crash(State& state, WorkerId id, Outbox& outbox) {
  const Worker& worker = state.workers.at(id);
  const bool is_certain = worker.num_lent == 1 && worker.unleased.empty();
  return blame(state, id, computed_runs(state, worker),
               is_certain ? Certainty::certain : Certainty::ambiguous, outbox);
}

RunsByCampaign blame_batch(State& state, WorkerId id, const Progress& batch, Outbox& outbox) {
  RunSet runs = leased_runs(state, state.workers.at(id), batch.campaign).overlap(batch.runs);
  RunsByCampaign accused;
  if (!runs.empty()) accused[batch.campaign] = std::move(runs);
  return blame(state, id, accused, certainty_of(batch.runs), outbox);
}

RunsByCampaign blame_simulation(State& state, WorkerId id, CampaignId campaign, const RunSet& runs,
                                Outbox& outbox) {
  const Worker& worker = state.workers.at(id);
  const RunSet accused = leased_runs(state, worker, campaign).overlap(runs);
  if (accused.empty() || state.quarantined.contains(worker.host)) return {};
  ++state.campaigns.at(campaign).outside_crashes[worker.session].num_in_a_row;
  return blame_all(state, worker.host, {{campaign, accused}}, certainty_of(runs), outbox);
}

void pause_crashing_campaigns(State& state, Outbox& outbox) {
  for (auto& [id, campaign] : state.campaigns) {
    std::erase_if(campaign.outside_crashes, [&](const auto& item) {
      return item.second.paused_until && state.ticked_at >= *item.second.paused_until;
    });
  }
  for (const auto& [worker_id, worker] : state.workers) {
    for (auto& [id, campaign] : state.campaigns) {
      const auto found = campaign.outside_crashes.find(worker.session);
      if (found == campaign.outside_crashes.end()) continue;
      OutsideCrashes& crashes = found->second;
      if (crashes.paused_until || crashes.num_in_a_row < state.config.crashes_per_host_max)
        continue;
      crashes.paused_until = state.ticked_at + state.config.quarantine_duration;
      // What a host says that has never computed anything must not keep others from trying.
      if (!is_proven(state, worker.host)) withdraw(state, id, worker.host);
      outbox.log(Event::error("campaign_paused_at_worker", {{"worker", worker_id.value},
                                                            {"name", worker.name},
                                                            {"crashes", crashes.num_in_a_row}}),
                 id);
    }
  }
}

namespace {

/// Whether a worker is to be lent the suspect once it has nothing else.
bool will_be_tried(const State& state, const CampaignState& campaign, const Suspicion& suspicion) {
  return std::ranges::any_of(state.workers, [&](const auto& item) {
    const Worker& worker = item.second;
    return worker.num_runs_max > 0 && !state.quarantined.contains(worker.host) &&
           can_compute(worker, campaign) && may_try(state, suspicion, worker);
  });
}

}  // namespace

bool is_guilty(const State& state, const Suspicion& suspicion) {
  const auto num_witnesses = std::ranges::count_if(
      suspicion.hosts, [](const auto& item) { return item.second.num_alone > 0; });
  return num_witnesses >= 2 && suspicion.num_crashes >= state.config.crashes_per_run_max;
}

void give_up_untried(State& state, Outbox& outbox) {
  if (state.workers.empty()) state.attended_since = state.ticked_at;
  for (const CampaignId id : state.served) {
    CampaignState& campaign = state.campaigns.at(id);
    std::erase_if(campaign.pending_suspects, [&](const auto& item) {
      const Suspicion& suspicion = campaign.suspects.at(item.first);
      const TimePoint waits_since = std::max(suspicion.tried_at, state.attended_since);
      if (state.ticked_at - waits_since < state.config.lone_witness_wait ||
          num_credible(state, suspicion) < state.config.crashes_per_run_max ||
          will_be_tried(state, campaign, suspicion)) {
        return false;
      }
      give_up(state, id, item.first, outbox);
      return true;
    });
  }
}

void give_up(State& state, CampaignId id, RunIndex run, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  const Suspicion suspicion = campaign.suspects.at(run);
  // The run is the cause, and not the hosts that have shown that they can compute.
  for (const auto& [id_of_host, on_host] : suspicion.hosts) {
    if (!is_proven(state, id_of_host)) continue;
    Host& host = state.hosts.at(id_of_host);
    host.num_crashes -= std::min(host.num_crashes, on_host.num_crashes);
  }
  for (const auto& [worker_id, worker] : state.workers) {
    if (!is_proven(state, worker.host) || !suspicion.hosts.contains(worker.host)) continue;
    campaign.outside_crashes.erase(worker.session);
  }
  campaign.suspects.erase(run);
  campaign.given_up.add({run, 1});
  outbox.write(id, GivenUpRun{run});
  outbox.log(Event::error("run_given_up", {{"run", run.value}, {"crashes", suspicion.num_crashes}}),
             id);
}

void note_lent_alone(Suspicion& suspicion, const Worker& worker, TimePoint now) {
  suspicion.tried_at = now;
  ++suspicion.hosts[worker.host].num_lent_alone;
}

bool may_try(const State& state, const Suspicion& suspicion, const Worker& worker) {
  const auto own = suspicion.hosts.find(worker.host);
  if (own == suspicion.hosts.end()) return true;
  const std::uint32_t crashes_max = state.config.crashes_per_run_max;
  const bool has_spoken = own->second.num_alone > 0 ? is_proven(state, worker.host)
                                                    : own->second.num_lent_alone >= crashes_max;
  if (has_spoken && suspicion.num_crashes >= crashes_max) return false;
  if (state.ticked_at - suspicion.tried_at >= state.config.lease_duration_max) return true;
  return std::ranges::none_of(state.hosts, [&](const auto& item) {
    const auto& [host, content] = item;
    return content.num_workers > 0 && !state.quarantined.contains(host) &&
           share_of_run(suspicion, host) < share_of_run(suspicion, worker.host);
  });
}

}  // namespace proofmass::coordinator::detail
