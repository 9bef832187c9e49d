#include "coordinator/dispatch/lending.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "coordinator/dispatch/blame.hpp"
#include "coordinator/dispatch/leases.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator::detail {
namespace {

std::uint64_t num_waiting(const CampaignState& campaign) {
  std::uint64_t count = campaign.pending_suspects.size() + campaign.num_to_audit;
  for (const auto& [attempt, runs] : campaign.pending) count += runs.size();
  return count;
}

double run_time_s(const CampaignState& campaign, CampaignId id, const Worker& worker) {
  const auto own = worker.run_time_s.find(id);
  return own != worker.run_time_s.end() ? own->second : campaign.run_time_s;
}

/// Rounds that all workers may have without more results than the memory should hold.
std::uint64_t rounds_with_room(const State& state, const CampaignState& campaign) {
  const std::uint64_t num_uncommitted = campaign.lent.size() + campaign.delivered.size();
  const std::uint64_t room_max = state.config.uncommitted_max;
  const std::uint64_t room = room_max - std::min(room_max, num_uncommitted);
  return std::max<std::uint64_t>(2, room / (2 * state.num_slots));
}

/// Rounds of work that a worker's slots should hold: one that is computed and one that waits, so
/// that a batch never starts with less than it has room for; more if runs are short. But never more
/// than half of a fair share of what is left, so that all workers finish together. Before the first
/// result one, as it may be that most workers have not registered yet.
std::uint64_t rounds_wanted(const State& state, CampaignId id, const CampaignState& campaign,
                            const Worker& worker) {
  const double time_s = run_time_s(campaign, id, worker);
  if (time_s <= 0.0) return 1;
  const double by_time = std::ceil(state.config.lease_work_s / time_s);
  const auto rounds = static_cast<std::uint64_t>(
      std::clamp(by_time, 2.0, static_cast<double>(wire::runs_per_lease_max)));
  const std::uint64_t slots = 2 * state.num_slots;
  const std::uint64_t by_share = (num_waiting(campaign) + slots - 1) / slots;
  return std::max<std::uint64_t>(1,
                                 std::min({rounds, by_share, rounds_with_room(state, campaign)}));
}

/// Runs of a campaign that a worker may hold if all of them together are not to deliver more than a
/// coordinator can take: the part of its slots in all that.
std::uint64_t share_of_intake(const State& state, CampaignId id, const CampaignState& campaign,
                              const Worker& worker) {
  const double known_s = run_time_s(campaign, id, worker);
  const double time_s = known_s > 0.0 ? known_s : state.config.run_time_s_expected;
  const double of_all = std::max(static_cast<double>(state.config.uncommitted_max),
                                 2.0 * time_s * state.config.results_per_s_max);
  const double fraction =
      static_cast<double>(worker.num_slots) / static_cast<double>(state.num_slots);
  const double limit = std::numeric_limits<std::uint32_t>::max();
  return static_cast<std::uint64_t>(std::clamp(fraction * of_all, 1.0, limit));
}

/// True if the worker needs nothing yet: it would not run low before the next of its results.
bool has_enough(const Worker& worker, std::uint64_t wanted) {
  const std::uint64_t two_rounds = 2 * static_cast<std::uint64_t>(worker.num_slots);
  return worker.num_lent >= std::min(wanted, two_rounds) && 2 * worker.num_lent > wanted;
}

std::vector<double> table_values(const Campaign& campaign, RunRange runs) {
  std::vector<double> values;
  if (campaign.table_columns.empty()) return values;
  values.reserve(runs.count * campaign.table_columns.size());
  for (std::uint64_t run = runs.first.value; run < runs.end(); ++run) {
    for (const std::vector<double>& column : campaign.table_columns) values.push_back(column[run]);
  }
  return values;
}

RunSet take_first(RunSet& runs, std::uint64_t count_max) {
  RunSet taken;
  while (taken.size() < count_max && !runs.empty()) {
    taken.add(runs.take_first(count_max - taken.size()));
  }
  return taken;
}

/// One worker that is being lent runs of one campaign.
struct Borrower {
  State& state;
  WorkerId id;
  Worker& worker;
  CampaignId campaign_id;
  CampaignState& campaign;
  std::uint64_t wanted;
  TimePoint now;
  Outbox& outbox;

  [[nodiscard]] std::uint64_t missing() const { return wanted - std::min(wanted, worker.num_lent); }
  [[nodiscard]] Lease lease_of(RunSet runs, Attempt attempt) const {
    return {.campaign = campaign_id,
            .worker = id,
            .attempt = attempt,
            .known_as = attempt,
            .remaining = std::move(runs),
            .lent_at = now,
            .audited = {}};
  }
  void open(Lease lease) const { send_lease(state, open_lease(state, std::move(lease)), outbox); }
};

/// Runs that were lent before come first, so that a campaign's early runs do not wait for its end.
void lend_pending(const Borrower& borrower) {
  auto& pending = borrower.campaign.pending;
  while (borrower.missing() > 0 && !pending.empty()) {
    const auto newest = std::prev(pending.end());
    const Attempt attempt = newest->first;
    RunSet runs = take_first(newest->second, borrower.missing());
    if (newest->second.empty()) pending.erase(newest);
    borrower.open(borrower.lease_of(std::move(runs), attempt));
  }
}

/// The only worker there is checks itself: better than nothing.
bool is_only_auditor(const State& state, WorkerId id) {
  return std::none_of(state.workers.begin(), state.workers.end(), [&](const auto& item) {
    return item.first != id && !state.quarantined.contains(item.second.host);
  });
}

void lend_audits(const Borrower& borrower) {
  auto& to_audit = borrower.campaign.to_audit;
  while (borrower.missing() > 0 && !to_audit.empty()) {
    auto next = to_audit.begin();
    if (next->first.first_worker == borrower.id) {
      next = to_audit.upper_bound({borrower.id, {std::numeric_limits<std::uint32_t>::max()}});
    }
    if (next == to_audit.end()) {
      if (!is_only_auditor(borrower.state, borrower.id)) return;
      next = to_audit.begin();
    }
    const AuditKey key = next->first;
    RunSet runs = take_first(next->second, borrower.missing());
    borrower.campaign.num_to_audit -= runs.size();
    if (next->second.empty()) to_audit.erase(next);
    Lease lease = borrower.lease_of(std::move(runs), key.attempt);
    lease.kind = LeaseKind::audit;
    lease.audited = key.first_worker;
    borrower.open(std::move(lease));
  }
}

/// Lends a suspect to a worker that has nothing else.
/// @return True if the worker is to get nothing else: it has one, or waits until it is idle.
bool lend_suspect(const Borrower& borrower) {
  CampaignState& campaign = borrower.campaign;
  const auto found = std::find_if(
      campaign.pending_suspects.begin(), campaign.pending_suspects.end(), [&](const auto& item) {
        return may_try(borrower.state, campaign.suspects.at(item.first), borrower.worker);
      });
  if (found == campaign.pending_suspects.end()) return false;
  const Worker& worker = borrower.worker;
  const bool is_clear = worker.unleased.empty() && borrower.now >= worker.clear_at;
  if (worker.num_lent > 0 || !is_clear) return true;
  const auto [run, attempt] = *found;
  campaign.pending_suspects.erase(found);
  Lease lease = borrower.lease_of(RunSet(RunRange{run, 1}), attempt);
  lease.is_alone = true;
  borrower.open(std::move(lease));
  return true;
}

/// @return True if the worker needs no runs of another campaign.
bool lend_of(State& state, WorkerId id, CampaignId campaign_id, TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(campaign_id);
  if (!is_lent(campaign) || is_backed_up(state, campaign)) return false;
  Worker& worker = state.workers.at(id);
  const std::uint64_t wanted = std::min<std::uint64_t>(
      {worker.num_slots * rounds_wanted(state, campaign_id, campaign, worker), worker.num_runs_max,
       share_of_intake(state, campaign_id, campaign, worker)});
  if (has_enough(worker, wanted)) return true;
  const Borrower borrower{state, id, worker, campaign_id, campaign, wanted, now, outbox};
  lend_pending(borrower);
  lend_audits(borrower);
  return lend_suspect(borrower) || borrower.missing() == 0;
}

bool has_runs_to_lend(const State& state) {
  return std::any_of(state.served.begin(), state.served.end(), [&](CampaignId id) {
    const CampaignState& campaign = state.campaigns.at(id);
    return is_lent(campaign) && !is_backed_up(state, campaign) &&
           !(campaign.pending.empty() && campaign.pending_suspects.empty() &&
             campaign.to_audit.empty());
  });
}

}  // namespace

void lend(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  state.hungry.erase(id);
  const Worker& worker = state.workers.at(id);
  if (!state.is_lending || is_passed_over(state, worker, now)) return;
  if (worker.num_lent >= worker.num_runs_max) return;
  if (!is_reattaching(state, now)) {
    for (const CampaignId campaign : state.served) {
      if (lend_of(state, id, campaign, now, outbox)) return;
    }
  }
  state.hungry.insert(id);
}

void lend_to_hungry(State& state, TimePoint now, Outbox& outbox) {
  if (is_reattaching(state, now)) return;
  auto next = state.hungry.begin();
  while (next != state.hungry.end() && has_runs_to_lend(state)) lend(state, *next++, now, outbox);
}

bool is_passed_over(const State& state, const Worker& worker, TimePoint now) {
  return worker.num_alone > 0 || now - worker.heard_at >= state.config.suspect_after ||
         state.quarantined.contains(worker.host);
}

bool is_reattaching(const State& state, TimePoint now) {
  return !state.awaited.empty() && now < state.awaited_until;
}

bool is_lent(const CampaignState& campaign) {
  return campaign.phase == Phase::active && campaign.storage_failure.empty();
}

bool is_backed_up(const State& state, const CampaignState& campaign) {
  const std::uint64_t num_under_way = campaign.delivered.size() + campaign.num_comparing;
  return 2 * num_under_way >= state.config.uncommitted_max;
}

void send_lease(const State& state, LeaseId id, Outbox& outbox) {
  const Lease& lease = state.leases.at(id);
  const Campaign& campaign = *state.campaigns.at(lease.campaign).definition;
  for (const RunRange& runs : lease.remaining.ranges()) {
    outbox.send(lease.worker, wire::RunLease{.campaign = lease.campaign,
                                             .runs = runs,
                                             .attempt = lease.attempt,
                                             .is_alone = lease.is_alone,
                                             .table_values = table_values(campaign, runs)});
  }
}

void sort_served(State& state) {
  state.served.clear();
  for (const CampaignId id : state.order) {
    if (state.campaigns.at(id).phase == Phase::active) state.served.push_back(id);
  }
  std::stable_sort(state.served.begin(), state.served.end(), [&](CampaignId a, CampaignId b) {
    return state.campaigns.at(a).priority > state.campaigns.at(b).priority;
  });
}

void send_not_served(const State& state, WorkerId worker, CampaignId id, Outbox& outbox) {
  if (const auto found = state.campaigns.find(id); found != state.campaigns.end()) {
    const std::uint64_t num_runs = found->second.definition->num_runs;
    return outbox.send(worker, wire::Forget{.campaign = id, .num_runs = num_runs});
  }
  if (const auto found = state.ended.find(id); found != state.ended.end()) {
    return outbox.send(worker, wire::Forget{.campaign = id, .num_runs = found->second});
  }
  outbox.send(worker, wire::NotServed{.campaign = id, .ranges = {}});
}

void finish_if_done(State& state, CampaignId id, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (campaign.phase == Phase::finished || campaign.phase == Phase::cancelled) return;
  if (!is_finished(campaign)) return;
  campaign.phase = Phase::finished;
  sort_served(state);
  const std::uint64_t num_elsewhere = campaign.elsewhere.size();
  outbox.log({.kind = num_elsewhere == 0 ? "campaign_finished" : "part_finished",
              .fields = {{"runs", campaign.definition->num_runs - num_elsewhere},
                         {"given_up", campaign.given_up.size()},
                         {"duplicates", campaign.num_duplicates},
                         {"compared", campaign.num_audited},
                         {"mismatches", campaign.num_mismatches}}},
             id);
  for (const auto& [worker, content] : state.workers) send_not_served(state, worker, id, outbox);
}

void settle(State& state, TimePoint now, Outbox& outbox) {
  const std::vector<CampaignId> order = state.order;
  for (const CampaignId id : order) finish_if_done(state, id, outbox);
  lend_to_hungry(state, now, outbox);
}

}  // namespace proofmass::coordinator::detail
