#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/dispatch/detail.hpp"
#include "coordinator/dispatch/events.hpp"
#include "core/error.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator {
namespace {

using RunsToAcknowledge = std::map<WorkerId, std::vector<RunIndex>>;

void send_acks(const State& state, CampaignId id, const RunsToAcknowledge& runs_by_worker,
               Outbox& outbox) {
  for (const auto& [worker, runs] : runs_by_worker) {
    if (!state.workers.contains(worker)) continue;
    for (std::size_t next = 0; next < runs.size();) {
      proto::Envelope envelope;
      proto::ResultAck& ack = *envelope.mutable_result_ack();
      ack.set_campaign(id.value);
      const std::size_t end = std::min(runs.size(), next + wire::runs_per_lease_max);
      while (next < end) ack.add_runs(runs[next++].value);
      outbox.send(worker, std::move(envelope));
    }
  }
}

/// What the worker only said that it holds was not lent to it.
bool is_lent_to(const State& state, const CampaignState& campaign, RunIndex run, WorkerId id) {
  const auto is_of = [&](LeaseId lease) {
    return state.leases.at(lease).worker == id && !state.leases.at(lease).is_adopted;
  };
  if (const auto first = campaign.lent.find(run); first && is_of(*first)) return true;
  const auto copies = campaign.copies.find(run);
  return copies != campaign.copies.end() && std::ranges::any_of(copies->second.leases, is_of);
}

/// Results of one worker for one campaign, on their way through the dispatch.
struct Intake {
  State& state;
  WorkerId id;
  Worker& worker;
  CampaignId campaign_id;
  CampaignState& campaign;
  Attempt attempt;
  Outbox& outbox;
  detail::RunsByWorker holders;   ///< Who else was lent the runs.
  std::vector<RunIndex> durable;  ///< To be acknowledged at once.

  void take(wire::ComputedRun computed) {
    const RunIndex run = computed.result.run;
    const bool is_kept = !was_computed_now(run);
    if (detail::close_run(state, campaign_id, run, id, holders)) {
      campaign.delivered[run] = {.attempt = attempt, .waiting = {id}, .is_kept = is_kept};
      state.finished_at = state.ticked_at;
      if (!computed.result.is_completed()) ++campaign.num_without_estimate;
      return outbox.write(campaign_id, delivery_of(std::move(computed)));
    }
    const auto delivered = campaign.delivered.find(run);
    if (delivered == campaign.delivered.end()) {
      durable.push_back(run);
      if (!end_audit(run)) ++campaign.num_duplicates;
      return compare(std::move(computed));
    }
    std::vector<WorkerId>& waiting = delivered->second.waiting;
    // One that waits repeats itself.
    if (std::find(waiting.begin(), waiting.end(), id) != waiting.end()) return;
    waiting.push_back(id);
    ++campaign.num_duplicates;
    compare(std::move(computed));
  }

 private:
  /// False of a result that the worker may have had when this coordinator first heard of the run:
  /// it was neither lent the run here nor seen computing it. What is seen in a heartbeat is most of
  /// what a worker goes on with after a restart: runs that take longer than the interval of
  /// heartbeats. Shorter ones that waited there are taken for finished, 1.5 s of work or a round.
  [[nodiscard]] bool was_computed_now(RunIndex run) const {
    return is_lent_to(state, campaign, run, id) ||
           std::ranges::any_of(worker.computing, [&](const Progress& batch) {
             return batch.campaign == campaign_id && batch.runs.contains(run);
           });
  }

  [[nodiscard]] Delivery delivery_of(wire::ComputedRun computed) const {
    detail::note_joined(campaign_id, worker, outbox);
    return {.result = std::move(computed.result),
            .worker = worker.session,
            .attempt = attempt,
            .compute_s = computed.compute_s};
  }

  // What a worker sends again and again must not fill the memory: one that is not compared, is
  // lost.
  void compare(wire::ComputedRun computed) {
    if (campaign.num_comparing >= state.config.uncommitted_max) return;
    ++campaign.num_comparing;
    outbox.write(campaign_id, SecondDelivery{delivery_of(std::move(computed))});
  }

  /// True if the run was on an audit lease of this worker.
  bool end_audit(RunIndex run) {
    const std::optional<LeaseId> audit = campaign.audits.find(run);
    if (!audit || state.leases.at(*audit).worker != id) return false;
    detail::take_off(state, *audit, {run, 1});
    campaign.audit_crashes.erase(run);
    return true;
  }
};

bool is_foreign(const CampaignState& campaign, const wire::ComputedRun& computed) {
  return computed.result.run.value >= campaign.definition->num_runs;
}

/// Those of the runs that the campaign does not have. That is no fault of the worker: the file may
/// be an older copy, and the runs come back when it is extended again.
RunSet foreign_runs(const CampaignState& campaign, std::span<const wire::ComputedRun> results) {
  RunSet foreign;
  for (const wire::ComputedRun& computed : results) {
    if (is_foreign(campaign, computed)) foreign.add({computed.result.run, 1});
  }
  return foreign;
}

/// A run that was given up has come after all: the campaign is finished again once it is stored.
void reopen_if_unfinished(State& state, CampaignState& campaign) {
  if (campaign.phase != Phase::finished) return;
  if (num_settled(campaign) == campaign.definition->num_runs) return;
  campaign.phase = Phase::active;
  detail::sort_served(state);
}

/// True if the result does not begin with the run's draw. Only of an open run that was not lent to
/// the worker: a draw takes longer than all else here.
bool is_made_up(const State& state, const CampaignState& campaign, const RunResult& result,
                WorkerId id) {
  if (is_lent_to(state, campaign, result.run, id)) return false;
  if (campaign.committed.contains(result.run) || campaign.delivered.contains(result.run)) {
    return false;
  }
  const RunDraw draw = campaign.definition->draw(result.run);
  return draw.num_draws != result.num_draws ||
         !std::ranges::equal(draw.truth, result.truth, {}, std::bit_cast<std::uint64_t, double>,
                             std::bit_cast<std::uint64_t, double>);
}

/// The rule that one of the results breaks, as `run 7: num_draws = 0 (...)`; empty if none does.
std::string broken_rule(const State& state, const CampaignState& campaign,
                        std::span<const wire::ComputedRun> results, WorkerId id) {
  const std::int64_t num_rounds_max = campaign.definition->num_rounds_max();
  const ResultSchema schema = campaign.definition->results();
  for (const wire::ComputedRun& computed : results) {
    std::vector<std::string> broken = broken_size_rules(computed.result, schema);
    if (broken.empty()) {
      broken = broken_count_rules(computed.result, schema.num_draws_max, num_rounds_max);
    }
    if (!broken.empty()) {
      return fmt::format("run {}: {}", computed.result.run.value, broken.front());
    }
    if (!is_foreign(campaign, computed) && is_made_up(state, campaign, computed.result, id)) {
      return fmt::format("run {}: truth (must be what the run draws)", computed.result.run.value);
    }
  }
  return {};
}

/// True if the run was lent together with fewer others than its slots have room for, to end sooner.
bool is_of_short_batch(const State& state, const CampaignState& campaign, RunIndex run) {
  const std::optional<LeaseId> id = campaign.lent.find(run);
  if (!id) return false;
  const Lease& lease = state.leases.at(*id);
  return lease.num_runs * lease.slots_per_run < lease.num_slots;
}

bool is_lent_to_cards(const State& state, const Worker& worker, const LeaseIndex& lent,
                      const wire::ComputedRun& computed) {
  const std::optional<LeaseId> lease = lent.find(computed.result.run);
  return lease && worker.leases.contains(*lease) && state.leases.at(*lease).is_for_cards;
}

/// Learns how fast the worker's cards are from a run that was lent to them.
void count_card_work(CardWork& work, TimePoint now) {
  const Duration busy = now - work.since;
  ++work.num_results;
  if (busy > Duration::zero()) work.rate = static_cast<double>(work.num_results) / seconds(busy);
}

/// Learns how long a run takes in its slot. Short batches say too little of it, unless nothing is
/// known.
void count_run_time(const State& state, Worker& worker, CampaignId id, CampaignState& campaign,
                    const wire::ComputedRun& computed, TimePoint now) {
  if (computed.is_by_card) {
    if (is_lent_to_cards(state, worker, campaign.lent, computed)) {
      count_card_work(worker.card_work.at(id), now);
    }
    return;
  }
  const bool is_known = campaign.run_time_s > 0.0;
  if (is_known && is_of_short_batch(state, campaign, computed.result.run)) return;
  const std::optional<LeaseId> lease = campaign.lent.find(computed.result.run);
  const Duration lent_for = lease ? now - state.leases.at(*lease).lent_at : Duration::zero();
  // A worker may say anything; 0 means that none is known.
  const double elapsed_s =
      std::clamp(computed.elapsed_s, 1e-9, seconds(lent_for + state.config.lease_duration_max));
  double& own_s = worker.run_time_s[id];
  own_s = running_mean(own_s, elapsed_s);
  campaign.run_time_s = running_mean(campaign.run_time_s, elapsed_s);
}

/// True if the worker's processors have computed what was lent to its cards.
bool have_cards_left_runs(const State& state, const Worker& worker, const LeaseIndex& lent,
                          std::span<const wire::ComputedRun> results) {
  return worker.num_lent_to_cards > 0 && std::ranges::any_of(results, [&](const auto& computed) {
           return !computed.is_by_card && is_lent_to_cards(state, worker, lent, computed);
         });
}

/// The worker's cards cannot compute the campaign: asks for what they hold.
void leave_out_cards(State& state, Worker& worker, CampaignId id, Outbox& outbox) {
  worker.card_work.at(id).can_compute = false;
  for (const LeaseId lease_id : worker.leases) {
    Lease& lease = state.leases.at(lease_id);
    if (lease.campaign != id || !lease.is_for_cards) continue;
    lease.is_retracted = true;
    detail::send_retract(lease.worker, id, lease.remaining, outbox);
  }
}

/// The worker and its host can compute: what they show with every result.
void count_results(State& state, Worker& worker, CampaignId id,
                   std::span<const wire::ComputedRun> results, TimePoint now) {
  if (results.empty()) return;
  CampaignState& campaign = state.campaigns.at(id);
  Host& host = state.hosts.at(worker.host);
  host.num_crashes = 0;
  host.num_results += results.size();
  worker.num_results += results.size();
  campaign.outside_crashes.erase(worker.session);
  worker.num_retracts = 0;
  const auto unleased = worker.unleased.find(id);
  for (const wire::ComputedRun& computed : results) {
    count_run_time(state, worker, id, campaign, computed, now);
    if (unleased != worker.unleased.end()) unleased->second.remove(computed.result.run);
  }
  if (unleased != worker.unleased.end() && unleased->second.empty()) {
    worker.unleased.erase(unleased);
  }
}

}  // namespace

void on_results(State& state, WorkerId id, CampaignId campaign_id, Attempt attempt,
                std::vector<wire::ComputedRun> results, TimePoint now, Outbox& outbox) {
  Worker* const worker = detail::heard(state, id, now, outbox);
  if (worker == nullptr) return;
  const auto found = state.campaigns.find(campaign_id);
  if (found == state.campaigns.end() || found->second.phase == Phase::cancelled) {
    return detail::send_not_served(state, id, campaign_id, outbox);
  }
  CampaignState& campaign = found->second;
  const RunSet foreign = foreign_runs(campaign, results);
  if (!foreign.empty()) detail::send_not_served(id, campaign_id, foreign.ranges(), outbox);
  if (const std::string broken = broken_rule(state, campaign, results, id); !broken.empty()) {
    outbox.log(Event::error("results_refused",
                            {{"worker", id.value}, {"name", worker->name}, Field::reason(broken)}),
               campaign_id);
    outbox.send(id, wire::rejection(proto::REJECT_REASON_MALFORMED, broken));
    return on_gone(state, id, LossReason::protocol, now, outbox);
  }
  std::erase_if(results, [&](const auto& computed) { return is_foreign(campaign, computed); });
  count_results(state, *worker, campaign_id, results, now);
  const bool have_left_runs = have_cards_left_runs(state, *worker, campaign.lent, results);
  Intake intake{state, id, *worker, campaign_id, campaign, attempt, outbox, {}, {}};
  for (wire::ComputedRun& computed : results) intake.take(std::move(computed));
  if (have_left_runs) leave_out_cards(state, *worker, campaign_id, outbox);
  if (!intake.durable.empty()) {
    send_acks(state, campaign_id, {{id, std::move(intake.durable)}}, outbox);
  }
  for (const auto& [holder, runs] : intake.holders) {
    detail::send_retract(holder, campaign_id, runs, outbox);
  }
  reopen_if_unfinished(state, campaign);
  detail::lend(state, id, now, outbox);
}

void on_committed(State& state, CampaignId id, std::span<const RunIndex> runs, TimePoint now,
                  Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  const bool was_backed_up = detail::is_backed_up(state, campaign);
  RunsToAcknowledge acknowledged;
  for (const RunIndex run : runs) {
    const auto found = campaign.delivered.find(run);
    PROOFMASS_EXPECT(found != campaign.delivered.end());
    const auto& [attempt, waiting, is_kept] = found->second;
    for (const WorkerId worker : waiting) acknowledged[worker].push_back(run);
    if (is_kept) ++campaign.num_kept;
    if (is_audited(campaign.definition->seed, run, campaign.audit_fraction)) {
      detail::add_to_audit(campaign,
                           {.first_worker = waiting.front(), .attempt = detail::after(attempt)},
                           RunSet(RunRange{run, 1}));
    }
    campaign.delivered.erase(found);
    campaign.committed.add({.first = run, .count = 1});
  }
  campaign.num_committed_here += runs.size();
  send_acks(state, id, acknowledged, outbox);
  detail::finish_if_done(state, id, outbox);
  if (was_backed_up || !campaign.to_audit.empty()) detail::lend_to_hungry(state, now, outbox);
}

void on_compared(State& state, CampaignId id, RunIndex run, WorkerId worker, bool is_equal,
                 TimePoint now, Outbox& outbox) {
  const auto found = state.campaigns.find(id);
  // The campaign may have been removed meanwhile, and added again.
  if (found == state.campaigns.end() || found->second.num_comparing == 0) return;
  CampaignState& campaign = found->second;
  const bool was_backed_up = detail::is_backed_up(state, campaign);
  --campaign.num_comparing;
  ++campaign.num_audited;
  if (!is_equal) {
    ++campaign.num_mismatches;
    outbox.log(Event::error("result_mismatch", {{"run", run.value}, {"worker", worker.value}}), id);
  }
  detail::finish_if_done(state, id, outbox);
  if (was_backed_up) detail::lend_to_hungry(state, now, outbox);
}

void on_store_failed(State& state, CampaignId id, const std::string& reason, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (campaign.storage_failure == reason) return;
  campaign.storage_failure = reason;
  outbox.log(Event::error("storage_failed", {Field::reason(reason)}), id);
}

void on_store_recovered(State& state, CampaignId id, TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (campaign.storage_failure.empty()) return;
  campaign.storage_failure.clear();
  outbox.log(Event::info("storage_recovered", {{"delivered", campaign.delivered.size()}}), id);
  detail::lend_to_hungry(state, now, outbox);
}

}  // namespace proofmass::coordinator
