#include "tests/coordinator/dispatch/invariants.hpp"

#include <algorithm>
#include <array>
#include <set>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

/// Adds the runs to a set that must hold none of them yet.
void add_disjoint(const RunSet& runs, RunSet& all) {
  const std::uint64_t size_expected = all.size() + runs.size();
  all.add(runs);
  PROOFMASS_EXPECT(all.size() == size_expected);
}

template <typename Value>
RunSet keys_of(const std::map<RunIndex, Value>& entries) {
  RunSet runs;
  for (const auto& [run, value] : entries) runs.add({run, 1});
  return runs;
}

void check_places(const CampaignState& campaign) {
  RunSet all = campaign.committed;
  for (const auto& [attempt, runs] : campaign.pending) {
    PROOFMASS_EXPECT(attempt.value >= 1 && !runs.empty());
    add_disjoint(runs, all);
  }
  add_disjoint(keys_of(campaign.pending_suspects), all);
  add_disjoint(campaign.lent.runs(), all);
  add_disjoint(keys_of(campaign.delivered), all);
  add_disjoint(campaign.given_up, all);
  add_disjoint(campaign.elsewhere, all);
  PROOFMASS_EXPECT(all == RunSet(RunRange{{0}, campaign.definition->num_runs}));
}

void check_suspects(const CampaignState& campaign) {
  for (const auto& [run, attempt] : campaign.pending_suspects) {
    PROOFMASS_EXPECT(campaign.suspects.contains(run));
  }
  for (const auto& [run, suspicion] : campaign.suspects) {
    PROOFMASS_EXPECT(suspicion.num_crashes > 0);
    PROOFMASS_EXPECT(campaign.pending_suspects.contains(run) || campaign.lent.find(run));
  }
}

void check_audits(const CampaignState& campaign) {
  RunSet all;
  for (const auto& [key, runs] : campaign.to_audit) {
    PROOFMASS_EXPECT(!runs.empty() && runs.overlap(campaign.committed) == runs);
    add_disjoint(runs, all);
  }
  PROOFMASS_EXPECT(campaign.num_to_audit == all.size());
  const RunSet& lent = campaign.audits.runs();
  PROOFMASS_EXPECT(lent.overlap(campaign.committed) == lent);
  add_disjoint(lent, all);
  for (const auto& [run, num_crashes] : campaign.audit_crashes) {
    PROOFMASS_EXPECT(all.contains(run));
  }
}

/// What the leases say about one campaign, counted afresh.
struct Counted {
  LeaseIndex lent;
  LeaseIndex audits;
  std::map<RunIndex, std::set<LeaseId>> copies;
};

void count_runs(LeaseId id, const Lease& lease, Counted& counted) {
  for (const RunRange& range : lease.remaining.ranges()) {
    if (lease.kind == LeaseKind::first) counted.lent.add(range, id);
    if (lease.kind == LeaseKind::audit) counted.audits.add(range, id);
    if (lease.kind != LeaseKind::copy) continue;
    for (const RunIndex run : indices_of(std::array{range})) counted.copies[run].insert(id);
  }
}

void check_same(const LeaseIndex& index, const LeaseIndex& counted) {
  PROOFMASS_EXPECT(index.runs() == counted.runs());
  for (const RunIndex run : indices_of(counted.runs().ranges())) {
    PROOFMASS_EXPECT(index.find(run) == counted.find(run));
  }
}

void check_index(const CampaignState& campaign, const Counted& counted) {
  check_same(campaign.lent, counted.lent);
  check_same(campaign.audits, counted.audits);
  for (const auto& [run, leases] : counted.copies) {
    PROOFMASS_EXPECT(campaign.copies.contains(run));
  }
  for (const auto& [run, copies] : campaign.copies) {
    PROOFMASS_EXPECT(campaign.lent.find(run).has_value());
    const auto found = counted.copies.find(run);
    const std::size_t num_expected = found == counted.copies.end() ? 0 : found->second.size();
    PROOFMASS_EXPECT(copies.leases.size() == num_expected);
    for (const LeaseId id : copies.leases) PROOFMASS_EXPECT(found->second.contains(id));
  }
}

void check_lease(const State& state, LeaseId id, const Lease& lease) {
  PROOFMASS_EXPECT(id.value >= 1 && id.value < state.next_lease);
  PROOFMASS_EXPECT(!lease.remaining.empty());
  PROOFMASS_EXPECT(lease.num_slots >= lease.num_runs && lease.num_runs >= lease.remaining.size());
  PROOFMASS_EXPECT(!lease.is_alone || lease.remaining.size() == 1);
  PROOFMASS_EXPECT(lease.known_as <= lease.attempt);
  PROOFMASS_EXPECT(state.workers.at(lease.worker).leases.contains(id));
  const Phase phase = state.campaigns.at(lease.campaign).phase;
  PROOFMASS_EXPECT(phase == Phase::active || phase == Phase::paused);
}

void check_workers(const State& state) {
  std::uint64_t num_slots = 0;
  std::uint64_t num_eligible = 0;
  std::uint64_t num_idle = 0;
  std::map<HostId, std::uint32_t> num_workers;
  for (const auto& [id, worker] : state.workers) {
    std::uint64_t num_lent = 0;
    std::uint64_t num_alone = 0;
    std::uint64_t num_lent_to_cards = 0;
    std::uint64_t num_slots_lent_for = 0;
    for (const LeaseId lease_id : worker.leases) {
      const Lease& lease = state.leases.at(lease_id);
      PROOFMASS_EXPECT(lease.worker == id);
      num_lent += lease.remaining.size();
      if (lease.is_alone) num_alone += lease.remaining.size();
      (lease.is_for_cards ? num_lent_to_cards : num_slots_lent_for) += num_slots_taken(lease);
    }
    PROOFMASS_EXPECT(worker.num_lent_to_cards == num_lent_to_cards);
    PROOFMASS_EXPECT(worker.num_slots_lent_for == num_slots_lent_for);
    PROOFMASS_EXPECT(worker.num_lent == num_lent && worker.num_alone == num_alone);
    num_slots += worker.num_slots;
    if (worker.is_eligible) {
      num_eligible += num_processor_slots(worker);
      num_idle += num_idle_slots(worker);
    }
    ++num_workers[worker.host];
  }
  PROOFMASS_EXPECT(state.num_slots == num_slots);
  PROOFMASS_EXPECT(state.num_eligible_slots == num_eligible && state.num_idle_slots == num_idle);
  for (const auto& [name, host] : state.hosts) {
    PROOFMASS_EXPECT(host.num_workers == num_workers[name]);
  }
  for (const WorkerId id : state.hungry) PROOFMASS_EXPECT(state.workers.contains(id));
}

/// What is known of a worker's crashes goes with it.
void check_outside_crashes(const State& state) {
  std::set<SessionId> sessions;
  for (const auto& [id, worker] : state.workers) sessions.insert(worker.session);
  for (const auto& [id, campaign] : state.campaigns) {
    for (const auto& [session, crashes] : campaign.outside_crashes) {
      PROOFMASS_EXPECT(sessions.contains(session) && crashes.num_in_a_row > 0);
    }
  }
}

void check_served(const State& state) {
  PROOFMASS_EXPECT(state.order.size() == state.campaigns.size());
  std::vector<CampaignId> served;
  for (const CampaignId id : state.order) {
    if (state.campaigns.at(id).phase == Phase::active) served.push_back(id);
  }
  std::stable_sort(served.begin(), served.end(), [&](CampaignId a, CampaignId b) {
    return state.campaigns.at(a).priority > state.campaigns.at(b).priority;
  });
  PROOFMASS_EXPECT(state.served == served);
}

}  // namespace

void check_invariants(const State& state) {
  std::map<CampaignId, Counted> counted;
  for (const auto& [id, lease] : state.leases) {
    check_lease(state, id, lease);
    count_runs(id, lease, counted[lease.campaign]);
  }
  for (const auto& [id, campaign] : state.campaigns) {
    check_places(campaign);
    check_suspects(campaign);
    check_audits(campaign);
    check_index(campaign, counted[id]);
    PROOFMASS_EXPECT(campaign.phase != Phase::finished ||
                     num_settled(campaign) == campaign.definition->num_runs);
  }
  check_workers(state);
  check_outside_crashes(state);
  check_served(state);
}

}  // namespace proofmass::coordinator
