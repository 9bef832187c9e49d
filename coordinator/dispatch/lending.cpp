#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "coordinator/dispatch/detail.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator::detail {
namespace {

/// Runs that a worker lacks, and the slots that they are for.
struct Share {
  std::uint64_t num_runs = 0;
  std::uint64_t num_slots = 0;

  /// Of the slots, for so many of the runs.
  [[nodiscard]] std::uint64_t slots_for(std::uint64_t count) const {
    return ratio_rounded_up(count * num_slots, num_runs);
  }
};

std::uint64_t num_waiting(const CampaignState& campaign) {
  std::uint64_t count = campaign.pending_suspects.size() + campaign.num_to_audit;
  for (const auto& [attempt, runs] : campaign.pending) count += runs.size();
  return count;
}

/// Slots of processors that may be lent runs, now or when they have come.
std::uint64_t num_slots_in_all(const State& state) {
  return state.num_eligible_slots + state.num_slots_expected;
}

double run_time_s(const CampaignState& campaign, CampaignId id, const Worker& worker) {
  const auto own = worker.run_time_s.find(id);
  return own != worker.run_time_s.end() ? own->second : campaign.run_time_s;
}

/// Slots that the runs of all campaigns which wait for such a worker would fill, or somewhat more
/// than `count_max` if they are more than that.
std::uint64_t num_waiting_in_all(const State& state, const Worker& worker,
                                 std::uint64_t count_max) {
  std::uint64_t count = 0;
  for (const CampaignId id : state.served) {
    const CampaignState& campaign = state.campaigns.at(id);
    if (!is_lent(campaign) || is_backed_up(state, campaign)) continue;
    if (!can_compute(worker, campaign)) continue;
    count += num_waiting(campaign) * slots_per_run(worker, campaign);
    if (count > count_max) break;
  }
  return count;
}

/// Rounds that all workers may have without more results than the memory should hold.
std::uint64_t rounds_with_room(const State& state, const CampaignState& campaign) {
  const std::uint64_t num_uncommitted = campaign.lent.runs().size() + campaign.delivered.size();
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
  if (time_s <= 0.0 || state.quarantined.contains(worker.host)) return 1;
  const double by_time = std::ceil(state.config.lease_work_s / time_s);
  const auto rounds = static_cast<std::uint64_t>(
      std::clamp(by_time, 2.0, static_cast<double>(wire::runs_per_lease_max)));
  const std::uint64_t slots = 2 * state.num_eligible_slots;
  const std::uint64_t by_share =
      ratio_rounded_up(num_waiting(campaign) * slots_per_run(worker, campaign), slots);
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

std::uint64_t num_lent_to_processors(const Worker& worker) {
  return worker.num_lent - worker.num_lent_to_cards;
}

/// Runs of the campaign that the worker's processors compute at a time.
std::uint64_t runs_per_round(const Worker& worker, const CampaignState& campaign) {
  return num_processor_slots(worker) / slots_per_run(worker, campaign);
}

/// True if the worker's processors need nothing yet: they would not run low before their next
/// result.
bool have_enough(const Worker& worker, const CampaignState& campaign, std::uint64_t wanted) {
  const std::uint64_t two_rounds = 2 * runs_per_round(worker, campaign);
  const std::uint64_t num_lent = num_lent_to_processors(worker);
  return num_lent >= std::min(wanted, two_rounds) && 2 * num_lent > wanted;
}

/// Slots that will soon want what waits: those that are idle, and those that have been computing
/// for half of the usual time of a run; before that time is known, no slot that was lent a run.
std::uint64_t num_slots_sharing(State& state, double time_s, TimePoint now) {
  if (time_s > 0.0) state.lately_lent.forget_before(now - bounded_duration(time_s / 2.0));
  const std::uint64_t num_in_all = num_slots_in_all(state);
  const std::uint64_t num_lately = std::min(num_in_all, state.lately_lent.num_slots());
  return std::max(num_in_all - num_lately, state.num_idle_slots + state.num_slots_expected);
}

/// A worker's part, by its idle slots, of the last runs: those that would fill at most half of the
/// slots that share them. A batch of half as many runs takes about half of the time. It is at least
/// an eighth of a run in each slot that runs need, as batches of less than that take hardly less
/// time.
/// @return Nothing if these are not the last runs.
std::optional<Share> share_of_last(State& state, CampaignId id, const CampaignState& campaign,
                                   const Worker& worker, TimePoint now) {
  const std::uint64_t num_sharing = num_slots_sharing(state, run_time_s(campaign, id, worker), now);
  const std::uint64_t count = num_waiting_in_all(state, worker, num_sharing);
  if (count == 0 || 2 * count > num_sharing) return std::nullopt;
  const std::uint64_t num_idle = num_idle_slots(worker);
  const std::uint64_t part = ratio_rounded_up(num_waiting(campaign) * num_idle, num_sharing);
  const std::uint64_t least = ratio_rounded_up(num_idle, 8 * slots_per_run(worker, campaign));
  return Share{.num_runs = std::max(part, least), .num_slots = num_idle};
}

/// Runs of a campaign that a worker may be lent beside those that it holds.
std::uint64_t room_of(const State& state, CampaignId id, const CampaignState& campaign,
                      const Worker& worker) {
  const std::uint64_t limit =
      std::min<std::uint64_t>(worker.num_runs_max, share_of_intake(state, id, campaign, worker));
  return limit - std::min(limit, worker.num_lent);
}

/// Runs a second that the cards of a worker compute; 0 if not known yet.
double card_rate(const Worker& worker, CampaignId id) {
  const auto found = worker.card_work.find(id);
  return found == worker.card_work.end() ? 0.0 : found->second.rate;
}

/// The part of a worker's cards in what all workers together compute: by their speeds, once all
/// are known, and until then by slots.
double part_of_cards(const State& state, CampaignId id, const CampaignState& campaign,
                     const Worker& worker) {
  const auto num_of_processors = static_cast<double>(num_slots_in_all(state));
  bool are_known = campaign.run_time_s > 0.0;
  double rate = are_known ? num_of_processors / campaign.run_time_s : 0.0;
  double num_slots = num_of_processors;
  for (const auto& [other_id, other] : state.workers) {
    if (!other.is_eligible || other.num_card_slots == 0) continue;
    are_known = are_known && card_rate(other, id) > 0.0;
    rate += card_rate(other, id);
    num_slots += other.num_card_slots;
  }
  return are_known ? card_rate(worker, id) / rate : worker.num_card_slots / num_slots;
}

/// What a worker's processors are to be lent of a campaign; nothing if they have enough.
Share share_of_processors(State& state, CampaignId id, const CampaignState& campaign,
                          const Worker& worker, TimePoint now) {
  const std::uint64_t room = room_of(state, id, campaign, worker);
  if (auto share = share_of_last(state, id, campaign, worker, now)) {
    share->num_runs = std::min(share->num_runs, room);
    return *share;
  }
  const std::uint64_t wanted =
      std::min(runs_per_round(worker, campaign) * rounds_wanted(state, id, campaign, worker),
               room + num_lent_to_processors(worker));
  if (have_enough(worker, campaign, wanted)) return {};
  const std::uint64_t num_missing = wanted - num_lent_to_processors(worker);
  return {.num_runs = num_missing, .num_slots = num_missing * slots_per_run(worker, campaign)};
}

/// What a worker's cards are to be lent of a campaign. They hold their part of all that is not
/// finished, so that everybody finishes together: a round until their speed is known, and then two
/// at most. A few runs take a card as long as many, so that what idle processors have room for is
/// left to them.
Share share_of_cards(const State& state, CampaignId id, const CampaignState& campaign,
                     const Worker& worker) {
  const auto work = worker.card_work.find(id);
  if (work != worker.card_work.end() && !work->second.can_compute) return {};
  if (worker.num_card_slots == 0) return {};
  if (num_waiting(campaign) <= state.num_idle_slots + state.num_slots_expected) return {};
  const std::uint64_t num_open = campaign.definition->num_runs - num_settled(campaign);
  const std::uint64_t num_slots = worker.num_card_slots;
  const auto part = static_cast<std::uint64_t>(part_of_cards(state, id, campaign, worker) *
                                               static_cast<double>(num_open));
  const std::uint64_t wanted =
      std::min(part, card_rate(worker, id) > 0.0 ? 2 * num_slots : num_slots);
  if (wanted <= worker.num_lent_to_cards) return {};
  const std::uint64_t num_missing =
      std::min(wanted - worker.num_lent_to_cards, room_of(state, id, campaign, worker));
  return {.num_runs = num_missing, .num_slots = num_missing};
}

/// One worker that is being lent runs of one campaign, for its processors or its cards.
struct Borrower {
  State& state;
  WorkerId id;
  Worker& worker;
  CampaignId campaign_id;
  CampaignState& campaign;
  std::uint64_t wanted;
  Share share;
  bool is_for_cards;
  TimePoint now;
  Outbox& outbox;

  [[nodiscard]] std::uint64_t missing() const { return wanted - std::min(wanted, worker.num_lent); }
  [[nodiscard]] std::uint64_t missing_of_lease() const {
    return std::min<std::uint64_t>(missing(), wire::runs_per_lease_max);
  }
  [[nodiscard]] Lease lease_of(RunSet runs, Attempt attempt) const {
    return {.campaign = campaign_id,
            .worker = id,
            .attempt = attempt,
            .known_as = attempt,
            .is_for_cards = is_for_cards,
            .num_slots = share.slots_for(runs.size()),
            .remaining = std::move(runs),
            .lent_at = now};
  }
  /// A card that was idle begins to be measured anew.
  void note_card_work() const {
    const auto [work, is_new] = worker.card_work.try_emplace(campaign_id);
    if (!is_new && worker.num_lent_to_cards > 0) return;
    work->second.since = now;
    work->second.num_results = 0;
  }
  void open(Lease lease) const {
    if (!is_for_cards) state.lately_lent.add(now, lease.num_slots);
    if (is_for_cards) note_card_work();
    send_lease(state, open_lease(state, std::move(lease)), outbox);
  }
};

/// Runs that were lent before come first, so that a campaign's early runs do not wait for its end.
void lend_pending(const Borrower& borrower) {
  auto& pending = borrower.campaign.pending;
  while (borrower.missing() > 0 && !pending.empty()) {
    const auto newest = std::prev(pending.end());
    const Attempt attempt = newest->first;
    RunSet runs = newest->second.take_first(borrower.missing_of_lease());
    if (newest->second.empty()) pending.erase(newest);
    borrower.open(borrower.lease_of(std::move(runs), attempt));
  }
}

/// The only worker there is checks itself: better than nothing.
bool is_only_auditor(const State& state, const CampaignState& campaign, WorkerId id) {
  return std::none_of(state.workers.begin(), state.workers.end(), [&](const auto& item) {
    return item.first != id && can_compute(item.second, campaign) &&
           !state.quarantined.contains(item.second.host);
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
      if (!is_only_auditor(borrower.state, borrower.campaign, borrower.id)) return;
      next = to_audit.begin();
    }
    const AuditKey key = next->first;
    RunSet runs = next->second.take_first(borrower.missing_of_lease());
    borrower.campaign.num_to_audit -= runs.size();
    if (next->second.empty()) to_audit.erase(next);
    Lease lease = borrower.lease_of(std::move(runs), key.attempt);
    lease.kind = LeaseKind::audit;
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
  note_lent_alone(campaign.suspects.at(run), worker, borrower.now);
  Lease lease = borrower.lease_of(RunSet(RunRange{run, 1}), attempt);
  lease.is_alone = true;
  lease.num_slots = 1;
  borrower.open(std::move(lease));
  return true;
}

/// @return True if the worker needs no runs of another campaign.
bool lend_of(State& state, WorkerId id, CampaignId campaign_id, TimePoint now, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(campaign_id);
  if (!is_lent(campaign) || is_backed_up(state, campaign)) return false;
  Worker& worker = state.workers.at(id);
  if (!can_compute(worker, campaign)) return false;
  const auto borrower_of = [&](const Share& share, bool is_for_cards) {
    const std::uint64_t wanted = worker.num_lent + share.num_runs;
    return Borrower{state,  id,    worker,       campaign_id, campaign,
                    wanted, share, is_for_cards, now,         outbox};
  };
  const Borrower processors =
      borrower_of(share_of_processors(state, campaign_id, campaign, worker, now), false);
  lend_pending(processors);
  lend_audits(processors);
  const bool have_processors_enough = processors.missing() == 0;
  const Borrower cards = borrower_of(share_of_cards(state, campaign_id, campaign, worker), true);
  lend_pending(cards);
  if (processors.share.num_runs > 0 && lend_suspect(processors)) return true;
  return have_processors_enough && worker.num_lent_to_cards >= worker.num_card_slots;
}

void send_forget(WorkerId worker, CampaignId id, std::uint64_t num_runs, Outbox& outbox) {
  proto::Envelope envelope;
  envelope.mutable_forget()->set_campaign(id.value);
  envelope.mutable_forget()->set_num_runs(num_runs);
  outbox.send(worker, std::move(envelope));
}

/// True if there are runs that nobody has, of a campaign that a worker can compute.
/// @param worker  Null: of any campaign.
bool has_runs_to_lend(const State& state, const Worker* worker) {
  return std::any_of(state.served.begin(), state.served.end(), [&](CampaignId id) {
    const CampaignState& campaign = state.campaigns.at(id);
    const bool has_any = !campaign.pending.empty() || !campaign.pending_suspects.empty() ||
                         !campaign.to_audit.empty();
    return has_any && is_lent(campaign) && !is_backed_up(state, campaign) &&
           (worker == nullptr || can_compute(*worker, campaign));
  });
}

}  // namespace

void lend(State& state, WorkerId id, TimePoint now, Outbox& outbox) {
  state.hungry.erase(id);
  Worker& worker = state.workers.at(id);
  set_eligible(state, worker, may_be_lent(state, worker, now));
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
  // In turn: one that gives runs back must not get them again and again.
  const Worker* const anybody = nullptr;
  for (std::size_t count = state.hungry.size(); count > 0; --count) {
    if (!has_runs_to_lend(state, anybody)) return;
    auto next = state.hungry.upper_bound(state.fed_last);
    if (next == state.hungry.end()) next = state.hungry.begin();
    if (next == state.hungry.end()) return;
    state.fed_last = *next;
    if (has_runs_to_lend(state, &state.workers.at(*next))) lend(state, *next, now, outbox);
  }
}

bool is_passed_over(const State& state, const Worker& worker, TimePoint now) {
  const bool is_barred = worker.num_results == 0 && state.quarantined.contains(worker.host);
  return worker.num_alone > 0 || now - worker.heard_at >= state.config.suspect_after || is_barred;
}

bool may_be_lent(const State& state, const Worker& worker, TimePoint now) {
  return worker.num_runs_max > 0 && !is_passed_over(state, worker, now);
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
    return send_forget(worker, id, num_runs, outbox);
  }
  if (const auto found = state.ended.find(id); found != state.ended.end()) {
    return send_forget(worker, id, found->second, outbox);
  }
  send_not_served(worker, id, {}, outbox);
}

void send_not_served(const State& state, CampaignId id, Outbox& outbox) {
  for (const auto& [worker, content] : state.workers) send_not_served(state, worker, id, outbox);
}

void send_not_served(WorkerId worker, CampaignId id, std::span<const RunRange> runs,
                     Outbox& outbox) {
  proto::Envelope envelope;
  envelope.mutable_not_served()->set_campaign(id.value);
  wire::add_ranges(runs, *envelope.mutable_not_served()->mutable_ranges());
  outbox.send(worker, std::move(envelope));
}

void finish_if_done(State& state, CampaignId id, Outbox& outbox) {
  CampaignState& campaign = state.campaigns.at(id);
  if (has_ended(campaign.phase) || !is_finished(campaign)) return;
  campaign.phase = Phase::finished;
  sort_served(state);
  const std::uint64_t num_elsewhere = campaign.elsewhere.size();
  const bool has_failed = campaign.given_up.size() > campaign.definition->num_runs / 2;
  const char* const kind = has_failed ? "campaign_failed" : "campaign_finished";
  outbox.log({.severity = has_failed ? Severity::error : Severity::info,
              .kind = num_elsewhere == 0 ? kind : "part_finished",
              .fields = {{"runs", campaign.definition->num_runs - num_elsewhere},
                         {"given_up", campaign.given_up.size()},
                         {"duplicates", campaign.num_duplicates},
                         {"compared", campaign.num_audited}}},
             id);
  send_not_served(state, id, outbox);
}

void settle(State& state, TimePoint now, Outbox& outbox) {
  const std::vector<CampaignId> order = state.order;
  for (const CampaignId id : order) finish_if_done(state, id, outbox);
  lend_to_hungry(state, now, outbox);
}

}  // namespace proofmass::coordinator::detail
