#include <algorithm>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "coordinator/dispatch/detail.hpp"
#include "core/math/hash.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::size_t copies_max = 2;

/// True if the worker could compute what others were lent.
bool could_help(const State& state, const Worker& worker) {
  return std::ranges::any_of(state.served, [&](CampaignId id) {
    const CampaignState& campaign = state.campaigns.at(id);
    const bool is_with_others = !campaign.lent.empty() || !campaign.audits.empty();
    return is_with_others && can_compute(worker, campaign);
  });
}

std::vector<WorkerId> idle_workers(const State& state, TimePoint now) {
  std::vector<WorkerId> idle;
  for (const WorkerId id : state.hungry) {
    const Worker& worker = state.workers.at(id);
    if (worker.num_lent == 0 && !is_passed_over(state, worker, now) && could_help(state, worker)) {
      idle.push_back(id);
    }
  }
  return idle;
}

/// Slots of its processors, which copies are for.
std::uint64_t room(const Worker& worker) {
  return std::min({num_processor_slots(worker), worker.num_runs_max, wire::runs_per_lease_max});
}

/// What the worker does not compute yet, as far as is known, and one of the idle ones could.
RunsByCampaign waiting_runs(const State& state, const Worker& worker,
                            const std::vector<WorkerId>& idle) {
  RunsByCampaign waiting;
  for (const LeaseId id : worker.leases) {
    const Lease& lease = state.leases.at(id);
    const CampaignState& campaign = state.campaigns.at(lease.campaign);
    const bool is_wanted = lease.kind == LeaseKind::first && !lease.is_alone &&
                           std::ranges::any_of(idle, [&](WorkerId other) {
                             return can_compute(state.workers.at(other), campaign);
                           });
    if (is_wanted && is_lent(campaign)) {
      waiting[lease.campaign].add(lease.remaining);
    }
  }
  for (const Progress& progress : worker.computing) {
    const auto found = waiting.find(progress.campaign);
    if (found != waiting.end()) found->second.remove(progress.runs);
  }
  return waiting;
}

/// Slots that the worker's runs need, if each takes no more than it must.
std::uint64_t num_slots_held(const State& state, const Worker& worker) {
  std::uint64_t count = 0;
  for (const LeaseId id : worker.leases) {
    const Lease& lease = state.leases.at(id);
    count += lease.remaining.size() * lease.slots_per_run;
  }
  return count;
}

/// Asks a worker that has more than its slots can hold for the rest of it, at most what
/// `count_max` slots can hold.
/// @return For how many slots it was asked.
std::uint64_t retract_from(State& state, WorkerId id, const std::vector<WorkerId>& idle,
                           std::uint64_t count_max, TimePoint now, Outbox& outbox) {
  Worker& worker = state.workers.at(id);
  if (num_slots_held(state, worker) <= worker.num_slots) return 0;
  std::uint64_t num_left =
      std::min<std::uint64_t>(count_max, num_slots_held(state, worker) - worker.num_slots);
  const std::uint64_t num_before = num_left;
  for (auto& [campaign, waiting] : waiting_runs(state, worker, idle)) {
    const std::uint64_t slots = slots_per_run(worker, state.campaigns.at(campaign));
    const std::uint64_t count = std::min(num_left / slots, waiting.size());
    if (count == 0) continue;
    send_retract(id, campaign, waiting.take_last(count), outbox);
    num_left -= count * slots;
  }
  if (num_left < num_before) {
    worker.retracted_at = now;
    ++worker.num_retracts;
  }
  return num_before - num_left;
}

/// True if the worker answers, and has had the time to.
bool may_be_asked(const State& state, const Worker& worker, TimePoint now) {
  constexpr int unanswered_max = 3;
  return worker.num_retracts < unanswered_max &&
         now - worker.heard_at < state.config.suspect_after &&
         now - worker.retracted_at >= state.config.heartbeat_interval;
}

std::uint64_t retract(State& state, const std::vector<WorkerId>& idle, std::uint64_t count_max,
                      TimePoint now, Outbox& outbox) {
  std::uint64_t num_asked = 0;
  for (const auto& [id, worker] : state.workers) {
    if (num_asked >= count_max) break;
    if (!may_be_asked(state, worker, now)) continue;
    num_asked += retract_from(state, id, idle, count_max - num_asked, now, outbox);
  }
  return num_asked;
}

/// True if the lease takes far longer than it usually would, or its worker may be gone. A lease has
/// its time before any usual one is known, too.
bool is_overdue(const State& state, const Lease& lease, TimePoint now) {
  const Worker& worker = state.workers.at(lease.worker);
  if (now - worker.heard_at >= state.config.suspect_after) return true;
  double usual_s = state.campaigns.at(lease.campaign).run_time_s;
  if (lease.is_for_cards) {
    const double rate = worker.card_work.at(lease.campaign).rate;
    usual_s = rate > 0.0 ? static_cast<double>(worker.num_lent_to_cards) / rate : 0.0;
  }
  if (usual_s <= 0.0) return now - lease.lent_at > state.config.lease_duration_max;
  return seconds(now - lease.lent_at) > 2.0 * std::max(usual_s, state.config.lease_work_s);
}

/// Copies for one idle worker.
class Copying {
 public:
  Copying(State& state, WorkerId id, TimePoint now)
      : state_(state), id_(id), now_(now), num_left_(room(state.workers.at(id))) {}

  /// Takes what there is room for of the runs of a lease.
  void take_from(const Lease& lease) {
    const Worker& worker = state_.workers.at(id_);
    const CampaignState& campaign = state_.campaigns.at(lease.campaign);
    if (lease.worker == id_ || !can_compute(worker, campaign)) return;
    const std::uint64_t slots = slots_per_run(worker, campaign);
    const auto& [copies, suspects] = std::tie(campaign.copies, campaign.suspects);
    for (const RunRange& range : lease.remaining.ranges()) {
      for (RunIndex run = range.first; run.value < range.end() && num_left_ >= slots; ++run.value) {
        const auto found = copies.find(run);
        if (suspects.contains(run) || (found != copies.end() && !may_copy(found->second))) continue;
        const Attempt newest = found == copies.end() ? lease.attempt : found->second.newest;
        runs_[{lease.campaign, after(newest)}].add({run, 1});
        num_left_ -= slots;
      }
    }
  }

  void lend(Outbox& outbox) {
    for (auto& [key, runs] : runs_) {
      const auto& [campaign, attempt] = key;
      const LeaseId lease = open_lease(state_, {.campaign = campaign,
                                                .worker = id_,
                                                .attempt = attempt,
                                                .known_as = attempt,
                                                .kind = LeaseKind::copy,
                                                .remaining = std::move(runs),
                                                .lent_at = now_});
      send_lease(state_, lease, outbox);
    }
    if (!runs_.empty()) detail::lend(state_, id_, now_, outbox);
  }

 private:
  /// Copies that are themselves too slow do not count, and a host gets one at a time: workers that
  /// compute nothing must not keep a run from the others.
  [[nodiscard]] bool may_copy(const Copies& copies) const {
    std::size_t num_recent = 0;
    for (const LeaseId id : copies.leases) {
      const Lease& lease = state_.leases.at(id);
      const Worker& holder = state_.workers.at(lease.worker);
      if (lease.worker == id_) return false;
      if (now_ - lease.lent_at > state_.config.lease_duration_max) continue;
      if (holder.host == state_.workers.at(id_).host) return false;
      ++num_recent;
    }
    return num_recent < copies_max;
  }

  State& state_;
  WorkerId id_;
  TimePoint now_;
  std::uint64_t num_left_;
  std::map<std::pair<CampaignId, Attempt>, RunSet> runs_;
};

/// True if there may be no copy of the lease: it is of an audit, or has a suspect.
bool is_exclusive(const State& state, const Lease& lease) {
  if (lease.kind == LeaseKind::audit || lease.is_alone) return true;
  const auto& suspects = state.campaigns.at(lease.campaign).suspects;
  return std::ranges::any_of(lease.remaining.ranges(), [&](const RunRange& range) {
    const auto next = suspects.lower_bound(range.first);
    return next != suspects.end() && next->first.value < range.end();
  });
}

/// Lends what there may be no copy of to the idle worker instead.
void take_over(State& state, LeaseId id, WorkerId idle, TimePoint now, Outbox& outbox) {
  const auto found = state.leases.find(id);
  if (found == state.leases.end() || found->second.worker == idle) return;
  if (!can_compute(state.workers.at(idle), state.campaigns.at(found->second.campaign))) return;
  const RunSet runs = found->second.remaining;
  send_retract(found->second.worker, found->second.campaign, runs, outbox);
  for (const RunRange& range : runs.ranges()) note_unleased(state, id, range);
  lose(state, id, runs, LossReason::retracted, {}, outbox);
  lend(state, idle, now, outbox);
}

void copy(State& state, std::vector<WorkerId> idle, TimePoint now, Outbox& outbox) {
  std::vector<LeaseId> overdue;
  std::vector<LeaseId> exclusive;
  constexpr Attempt often{4};  // It comes back again and again.
  for (const auto& [id, lease] : state.leases) {
    if (lease.kind == LeaseKind::copy || !is_lent(state.campaigns.at(lease.campaign))) continue;
    const bool is_late = is_overdue(state, lease, now);
    // By then it is known whether its batch hangs.
    const bool had_its_time = now - lease.lent_at > 6 * state.config.hung_after_min;
    const bool has_no_copy = is_exclusive(state, lease);
    if (has_no_copy && is_late && had_its_time) exclusive.push_back(id);
    if (!has_no_copy && (is_late || lease.attempt >= often)) overdue.push_back(id);
  }
  // Another one is the first each time.
  std::ranges::sort(idle, {}, [&](WorkerId id) { return mixed(id.value + state.next_lease); });
  for (const LeaseId id : exclusive) {
    for (const WorkerId worker : idle) {
      if (state.workers.at(worker).num_lent == 0) take_over(state, id, worker, now, outbox);
    }
  }
  if (overdue.empty()) return;
  for (const WorkerId id : idle) {
    if (state.workers.at(id).num_lent > 0) continue;
    Copying copying(state, id, now);
    for (const LeaseId lease : overdue) copying.take_from(state.leases.at(lease));
    copying.lend(outbox);
  }
}

/// Says that workers hold runs and finish none, although others could compute them.
void note_standstill(State& state, std::size_t num_idle, TimePoint now, Outbox& outbox) {
  if (state.leases.empty()) state.finished_at = now;
  if (now - state.finished_at < state.config.lease_duration_max) return;
  outbox.log(Event::warning(
      "nothing_finished", {{"for_s", static_cast<std::uint64_t>(seconds(now - state.finished_at))},
                           {"leases", state.leases.size()},
                           {"idle_workers", num_idle}}));
  state.finished_at = now;
}

/// Then workers are idle although this is not the end.
bool waits_for_a_store(const State& state) {
  return std::any_of(state.served.begin(), state.served.end(),
                     [&](CampaignId id) { return is_backed_up(state, state.campaigns.at(id)); });
}

}  // namespace

void speculate(State& state, TimePoint now, Outbox& outbox) {
  if (!state.is_lending || is_reattaching(state, now) || waits_for_a_store(state)) return;
  std::vector<WorkerId> idle = idle_workers(state, now);
  if (idle.empty()) return;
  note_standstill(state, idle.size(), now, outbox);
  std::uint64_t num_wanted = 0;
  for (const WorkerId id : idle) num_wanted += room(state.workers.at(id));
  std::uint64_t num_coming = retract(state, idle, num_wanted, now, outbox);
  while (!idle.empty() && num_coming > 0) {
    num_coming -= std::min(num_coming, room(state.workers.at(idle.back())));
    idle.pop_back();
  }
  copy(state, std::move(idle), now, outbox);
}

}  // namespace proofmass::coordinator::detail
