#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "coordinator/dispatch/detail.hpp"

namespace proofmass::coordinator::detail {
namespace {

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

/// Runs on the leases of a worker's processors.
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

}  // namespace

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

}  // namespace proofmass::coordinator::detail
