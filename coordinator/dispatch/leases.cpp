#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include "coordinator/dispatch/detail.hpp"
#include "core/error.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// For the worker of a lease of which the remaining runs have changed.
void note_slots(State& state, Worker& worker, bool is_for_cards, std::uint64_t num_before,
                std::uint64_t num_now) {
  if (is_for_cards) {
    worker.num_lent_to_cards += num_now - num_before;
    return;
  }
  if (worker.is_eligible) state.num_idle_slots -= num_idle_slots(worker);
  worker.num_slots_lent_for += num_now - num_before;
  if (worker.is_eligible) state.num_idle_slots += num_idle_slots(worker);
}

/// Where the runs of such leases are; null of copies, of which a run may be on several.
LeaseIndex* index_of(CampaignState& campaign, LeaseKind kind) {
  if (kind == LeaseKind::copy) return nullptr;
  return kind == LeaseKind::first ? &campaign.lent : &campaign.audits;
}

/// A copy becomes the first lease of its run.
void promote_copy(State& state, CampaignId id, RunIndex run, LeaseId copy) {
  const Lease& old = state.leases.at(copy);
  Lease lease{.campaign = id,
              .worker = old.worker,
              .attempt = old.attempt,
              .known_as = old.known_as,
              .is_retracted = old.is_retracted,
              .remaining = RunSet(RunRange{run, 1}),
              .lent_at = old.lent_at};
  take_off(state, copy, {run, 1});
  (void)open_lease(state, std::move(lease));
}

/// Takes a suspect off its copies and asks for it back: it must be tried alone. Their workers may
/// be computing it already.
void drop_copies(State& state, CampaignId id, RunIndex run, Outbox& outbox) {
  const std::vector<LeaseId> leases = state.campaigns.at(id).copies.at(run).leases;
  for (const LeaseId lease : leases) {
    const WorkerId holder = state.leases.at(lease).worker;
    note_unleased(state, lease, {run, 1});
    take_off(state, lease, {run, 1});
    send_retract(holder, id, RunSet(RunRange{run, 1}), outbox);
  }
}

/// For runs that were taken off their first lease: those with a copy go on there, unless they are
/// suspects, which must be tried alone.
/// @return The runs that have no place now.
RunSet promote_copies(State& state, CampaignId id, RunSet runs, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  for (const RunRange& range : runs.ranges()) {
    auto next = campaign.copies.lower_bound(range.first);
    while (next != campaign.copies.end() && next->first.value < range.end()) {
      const auto [run, copies] = *next;
      runs.remove(run);
      const bool is_suspect = campaign.suspects.contains(run);
      if (is_suspect) drop_copies(state, id, run, outbox);
      if (is_suspect || copies.leases.empty()) {
        next = campaign.copies.erase(next);
        make_pending(state, id, RunSet(RunRange{run, 1}), after(copies.newest), outbox);
      } else {
        promote_copy(state, id, run, copies.leases.front());
        ++next;
      }
    }
  }
  return runs;
}

void record_losses(const Lease& lease, Worker& worker, const RunSet& runs, LossReason reason,
                   bool is_blamed, Outbox& outbox) {
  for (const RunRange& range : runs.ranges()) {
    note_joined(lease.campaign, worker, outbox);
    outbox.write(lease.campaign, ReturnedRuns{.runs = range,
                                              .attempt = lease.attempt,
                                              .worker = worker.session,
                                              .reason = reason,
                                              .is_blamed = is_blamed});
  }
}

void log_loss(const Lease& lease, const RunSet& runs, LossReason reason, const RunSet& blamed,
              Outbox& outbox) {
  wire::Fields fields{{"worker", lease.worker.value},
                      {"runs", to_text(runs)},
                      {"attempt", lease.attempt.value},
                      {"reason", name_of(reason)}};
  if (!blamed.empty()) fields.emplace_back("blamed", to_text(blamed));
  const bool is_wanted = reason == LossReason::retracted;
  outbox.log({.severity = is_wanted ? Severity::info : Severity::warning,
              .kind = is_wanted ? "runs_taken_back" : "runs_lost",
              .fields = std::move(fields)},
             lease.campaign);
}

bool remove_from_pending(CampaignState& campaign, RunIndex run) {
  if (campaign.pending_suspects.erase(run) == 1) return true;
  for (auto runs = campaign.pending.begin(); runs != campaign.pending.end(); ++runs) {
    if (!runs->second.remove(run)) continue;
    if (runs->second.empty()) campaign.pending.erase(runs);
    return true;
  }
  return false;
}

void take_off_and_tell(State& state, LeaseId lease, RunIndex run, WorkerId by,
                       RunsByWorker& holders) {
  const WorkerId worker = state.leases.at(lease).worker;
  if (worker != by) holders[worker].add({run, 1});
  take_off(state, lease, {run, 1});
}

}  // namespace

void set_eligible(State& state, Worker& worker, bool is_eligible) {
  if (is_eligible == worker.is_eligible) return;
  worker.is_eligible = is_eligible;
  if (is_eligible) {
    state.num_eligible_slots += num_processor_slots(worker);
    state.num_idle_slots += num_idle_slots(worker);
  } else {
    state.num_eligible_slots -= num_processor_slots(worker);
    state.num_idle_slots -= num_idle_slots(worker);
  }
}

Attempt after(Attempt attempt) {
  constexpr std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  return {attempt.value == last ? last : attempt.value + 1};
}

LeaseId open_lease(State& state, Lease lease) {
  PROOFMASS_EXPECT(!lease.remaining.empty());
  CampaignState& campaign = state.campaigns.at(lease.campaign);
  lease.num_runs = lease.remaining.size();
  if (!lease.is_for_cards) {
    lease.slots_per_run = slots_per_run(state.workers.at(lease.worker), campaign);
  }
  lease.num_slots = std::max(lease.num_slots, lease.num_runs * lease.slots_per_run);
  const LeaseId id{state.next_lease++};
  for (const RunRange& range : lease.remaining.ranges()) {
    if (LeaseIndex* const index = index_of(campaign, lease.kind)) {
      index->add(range, id);
      continue;
    }
    for (std::uint64_t run = range.first.value; run < range.end(); ++run) {
      Copies& copies = campaign.copies[{run}];
      copies.leases.push_back(id);
      copies.newest = std::max(copies.newest, lease.attempt);
    }
  }
  Worker& worker = state.workers.at(lease.worker);
  worker.num_lent += lease.num_runs;
  note_slots(state, worker, lease.is_for_cards, 0, lease.num_slots);
  if (lease.is_alone) worker.num_alone += lease.remaining.size();
  worker.leases.insert(id);
  state.leases.emplace(id, std::move(lease));
  return id;
}

void take_off(State& state, LeaseId id, RunRange runs) {
  const auto found = state.leases.find(id);
  PROOFMASS_EXPECT(found != state.leases.end());
  Lease& lease = found->second;
  CampaignState& campaign = state.campaigns.at(lease.campaign);
  const std::uint64_t size_before = lease.remaining.size();
  const std::uint64_t num_slots_before = num_slots_taken(lease);
  lease.remaining.remove(runs);
  PROOFMASS_EXPECT(size_before - lease.remaining.size() == runs.count);
  if (LeaseIndex* const index = index_of(campaign, lease.kind)) {
    index->remove(runs);
  } else {
    for (std::uint64_t run = runs.first.value; run < runs.end(); ++run) {
      std::erase(campaign.copies.at({run}).leases, id);
    }
  }
  Worker& worker = state.workers.at(lease.worker);
  worker.num_lent -= runs.count;
  note_slots(state, worker, lease.is_for_cards, num_slots_before, num_slots_taken(lease));
  if (lease.is_alone) worker.num_alone -= runs.count;
  if (!lease.remaining.empty()) return;
  worker.leases.erase(id);
  state.leases.erase(found);
}

/// What the worker may claim if it still holds it.
void note_lent_before(State& state, const Lease& lease, const RunSet& runs) {
  auto& sessions = state.lent_before;
  const SessionId session = state.workers.at(lease.worker).session;
  if (sessions.size() >= state.config.num_workers_max && !sessions.contains(session)) {
    sessions.erase(sessions.begin());
  }
  sessions[session][lease.campaign].add(runs);
}

void note_unleased(State& state, LeaseId id, RunRange runs) {
  const Lease& lease = state.leases.at(id);
  note_lent_before(state, lease, RunSet(runs));
  Worker& worker = state.workers.at(lease.worker);
  worker.unleased[lease.campaign].add(runs);
  worker.clear_at = std::max(worker.clear_at, lease.lent_at + state.config.arrival_max);
}

void note_joined(CampaignId campaign, Worker& worker, Outbox& outbox) {
  if (!worker.joined.insert(campaign).second) return;
  outbox.write(campaign, WorkerJoined{.session = worker.session,
                                      .name = worker.name,
                                      .host = worker.host_name,
                                      .process_id = worker.process_id,
                                      .num_slots = worker.num_slots,
                                      .cards = worker.cards});
}

void lose(State& state, LeaseId id, const RunSet& runs, LossReason reason, const RunSet& blamed,
          Outbox& outbox) {
  const Lease lease = state.leases.at(id);
  note_lent_before(state, lease, runs);
  const RunSet guilty = runs.overlap(blamed);
  RunSet others = runs;
  others.remove(guilty);
  Worker& worker = state.workers.at(lease.worker);
  record_losses(lease, worker, guilty, reason, true, outbox);
  record_losses(lease, worker, others, reason, false, outbox);
  log_loss(lease, runs, reason, guilty, outbox);
  for (const RunRange& range : runs.ranges()) take_off(state, id, range);
  state.hungry.insert(lease.worker);  // It has room for others now.
  if (lease.kind == LeaseKind::first) {
    RunSet open = promote_copies(state, lease.campaign, runs, outbox);
    make_pending(state, lease.campaign, std::move(open), after(lease.attempt), outbox);
  }
  if (lease.kind == LeaseKind::audit) {
    // The worker that was to check it does not, so that any worker may.
    add_to_audit(state.campaigns.at(lease.campaign),
                 {.first_worker = {}, .attempt = after(lease.attempt)}, runs);
  }
}

void make_pending(State& state, CampaignId id, RunSet runs, Attempt attempt, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  for (const RunRange& range : runs.ranges()) {
    auto next = campaign.suspects.lower_bound(range.first);
    while (next != campaign.suspects.end() && next->first.value < range.end()) {
      const auto current = next++;
      const RunIndex run = current->first;
      runs.remove(run);
      if (is_guilty(state, current->second)) {
        give_up(state, id, run, outbox);
      } else {
        campaign.pending_suspects.emplace(run, attempt);
      }
    }
  }
  if (!runs.empty()) campaign.pending[attempt].add(runs);
}

void add_to_audit(CampaignState& campaign, const AuditKey& key, const RunSet& runs) {
  RunSet& to_audit = campaign.to_audit[key];
  const std::uint64_t size_before = to_audit.size();
  to_audit.add(runs);
  campaign.num_to_audit += to_audit.size() - size_before;
}

bool close_run(State& state, CampaignId id, RunIndex run, WorkerId by, RunsByWorker& holders) {
  CampaignState& campaign = state.campaigns.at(id);
  if (const auto first = campaign.lent.find(run)) {
    take_off_and_tell(state, *first, run, by, holders);
    if (const auto found = campaign.copies.find(run); found != campaign.copies.end()) {
      const std::vector<LeaseId> copies = found->second.leases;
      for (const LeaseId copy : copies) take_off_and_tell(state, copy, run, by, holders);
      campaign.copies.erase(run);
    }
  } else if (!remove_from_pending(campaign, run) && !campaign.given_up.remove(run) &&
             !campaign.elsewhere.remove(run)) {
    return false;
  }
  campaign.suspects.erase(run);
  return true;
}

RunsByCampaign leased_runs(const State& state, const Worker& worker) {
  RunsByCampaign runs;
  for (const LeaseId id : worker.leases) {
    const Lease& lease = state.leases.at(id);
    runs[lease.campaign].add(lease.remaining);
  }
  return runs;
}

RunSet leased_runs(const State& state, const Worker& worker, CampaignId campaign) {
  RunSet runs;
  for (const LeaseId id : worker.leases) {
    const Lease& lease = state.leases.at(id);
    if (lease.campaign == campaign) runs.add(lease.remaining);
  }
  return runs;
}

void send_retract(WorkerId worker, CampaignId campaign, const RunSet& runs, Outbox& outbox) {
  const std::vector<RunRange> ranges = runs.ranges();
  for (std::size_t first = 0; first < ranges.size(); first += wire::ranges_per_message_max) {
    const std::size_t count = std::min(wire::ranges_per_message_max, ranges.size() - first);
    proto::Envelope envelope;
    envelope.mutable_retract()->set_campaign(campaign.value);
    wire::add_ranges(std::span(ranges).subspan(first, count),
                     *envelope.mutable_retract()->mutable_ranges());
    outbox.send(worker, std::move(envelope));
  }
}

void remove_worker(State& state, WorkerId id, LossReason reason, const RunsByCampaign& blamed,
                   Outbox& outbox) {
  Worker& worker = state.workers.at(id);
  while (!worker.leases.empty()) {
    const LeaseId lease_id = *worker.leases.begin();
    const Lease& lease = state.leases.at(lease_id);
    const auto guilty = blamed.find(lease.campaign);
    const RunSet runs = lease.remaining;
    lose(state, lease_id, runs, reason, guilty == blamed.end() ? RunSet() : guilty->second, outbox);
  }
  set_eligible(state, worker, false);
  state.num_slots -= worker.num_slots;
  state.num_slots_expected = 0;  // As many as were expected do not come.
  const auto found = state.hosts.find(worker.host);
  Host& host = found->second;
  --host.num_workers;
  host.left_at = std::max(host.left_at, worker.heard_at);
  if (host.num_workers == 0 && host.num_crashes == 0 && host.num_results == 0) {
    state.hosts.erase(found);
  }
  for (auto& [campaign_id, campaign] : state.campaigns) {
    campaign.outside_crashes.erase(worker.session);
  }
  state.hungry.erase(id);
  state.awaited.erase(worker.session);
  outbox.write({}, WorkerEnded{.session = worker.session, .reason = reason});
  state.workers.erase(id);
}

namespace {

/// Runs whose table values have room in a message.
std::uint64_t runs_per_message(const Campaign& campaign) {
  const std::size_t run_size = sizeof(double) * campaign.table_columns.size();
  if (run_size == 0) return wire::runs_per_lease_max;
  return std::clamp<std::uint64_t>(wire::message_size_max / 2 / run_size, 1,
                                   wire::runs_per_lease_max);
}

void add_table_values(const Campaign& campaign, RunRange runs, proto::RunLease& lease) {
  if (campaign.table_columns.empty()) return;
  for (std::uint64_t run = runs.first.value; run < runs.end(); ++run) {
    for (const std::vector<double>& column : campaign.table_columns) {
      lease.add_table_values(column[run]);
    }
  }
}

/// A batch of a lease has the same part in its runs as in its slots.
std::uint32_t batch_runs_max(const Lease& lease, const Campaign& campaign) {
  const std::uint64_t num_slots_needed = lease.num_runs * lease.slots_per_run;
  if (num_slots_needed >= lease.num_slots) return 0;
  const std::uint64_t batch_size = campaign.model().batch_size();
  return static_cast<std::uint32_t>(
      ratio_rounded_up(num_slots_needed * batch_size, lease.num_slots));
}

}  // namespace

void send_lease(State& state, LeaseId id, Outbox& outbox) {
  const Lease& lease = state.leases.at(id);
  note_joined(lease.campaign, state.workers.at(lease.worker), outbox);
  const Campaign& campaign = *state.campaigns.at(lease.campaign).definition;
  const std::uint64_t count_max = runs_per_message(campaign);
  for (const RunRange& range : lease.remaining.ranges()) {
    for (std::uint64_t begin = 0; begin < range.count; begin += count_max) {
      const RunRange runs{.first = {range.first.value + begin},
                          .count = std::min(count_max, range.count - begin)};
      proto::Envelope envelope;
      proto::RunLease& message = *envelope.mutable_run_lease();
      message.set_campaign(lease.campaign.value);
      message.set_first_run(runs.first.value);
      message.set_num_runs(static_cast<std::uint32_t>(runs.count));
      message.set_attempt(lease.attempt.value);
      message.set_is_alone(lease.is_alone);
      message.set_batch_runs_max(batch_runs_max(lease, campaign));
      message.set_is_for_cards(lease.is_for_cards);
      add_table_values(campaign, runs, message);
      outbox.send(lease.worker, std::move(envelope));
    }
  }
}

}  // namespace proofmass::coordinator::detail
