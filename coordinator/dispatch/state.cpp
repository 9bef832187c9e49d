#include "coordinator/dispatch/state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "coordinator/dispatch/detail.hpp"
#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {

State initial_state(const DispatchConfig& config, std::set<SessionId> awaited, TimePoint now) {
  State state;
  state.config = config;
  state.attached = awaited;
  state.absent = awaited;
  state.awaited = std::move(awaited);
  state.awaited_until = now + config.reattach_wait;
  state.num_slots_expected = config.num_slots_expected;
  state.hello_allowance = config.hellos_per_s_max;
  state.hello_allowance_at = now;
  state.ticked_at = now;
  state.finished_at = now;
  state.attended_since = now;
  return state;
}

void LentSlots::add(TimePoint now, std::uint64_t num_slots) {
  if (lent_.size() == times_max) forget_first();
  lent_.emplace_back(now, num_slots);
  num_slots_ += num_slots;
}

void LentSlots::forget_before(TimePoint time) {
  while (!lent_.empty() && lent_.front().first < time) forget_first();
}

void LentSlots::forget_first() {
  num_slots_ -= lent_.front().second;
  lent_.pop_front();
}

std::uint64_t num_slots_taken(const Lease& lease) {
  return (lease.remaining.size() * lease.num_slots + lease.num_runs - 1) / lease.num_runs;
}

std::uint64_t num_settled(const CampaignState& campaign) {
  return campaign.committed.size() + campaign.given_up.size() + campaign.elsewhere.size();
}

bool is_finished(const CampaignState& campaign) {
  return num_settled(campaign) == campaign.definition->num_runs && campaign.to_audit.empty() &&
         campaign.audits.empty() && campaign.num_comparing == 0;
}

bool is_accepted(const ModelIdentity& model, const CampaignState& campaign) {
  const ModelIdentity& wanted = campaign.model;
  if (model.version != wanted.version) return false;
  if (model.reference_digest == wanted.reference_digest) return true;
  return campaign.definition->tolerates_digests() &&
         model.description_digest == wanted.description_digest;
}

bool has_model(const Worker& worker, const CampaignState& campaign) {
  return std::ranges::any_of(
      worker.models, [&](const ModelIdentity& model) { return is_accepted(model, campaign); });
}

bool can_compute(const Worker& worker, const CampaignState& campaign) {
  const auto crashes = campaign.outside_crashes.find(worker.session);
  const bool is_paused =
      crashes != campaign.outside_crashes.end() && crashes->second.paused_until.has_value();
  return !is_paused && has_model(worker, campaign);
}

bool lacks_workers(const State& state, const CampaignState& campaign) {
  return campaign.phase == Phase::active && !state.workers.empty() &&
         std::ranges::none_of(state.workers,
                              [&](const auto& item) { return has_model(item.second, campaign); });
}

bool crashes_everywhere(const State& state, const CampaignState& campaign) {
  return campaign.phase == Phase::active && !state.workers.empty() &&
         !lacks_workers(state, campaign) &&
         std::ranges::none_of(state.workers,
                              [&](const auto& item) { return can_compute(item.second, campaign); });
}

std::uint64_t slots_per_run(const Worker& worker, const CampaignState& campaign) {
  const std::uint64_t batch_size = campaign.definition->model().batch_size();
  return std::max<std::uint64_t>(1, worker.slots_per_thread / batch_size);
}

bool expects_no_result(const CampaignState& campaign) {
  return campaign.pending.empty() && campaign.pending_suspects.empty() && campaign.lent.empty();
}

bool is_quiet(const State& state, const std::set<CampaignId>& lost) {
  if (!state.leases.empty()) return false;
  for (const auto& [id, campaign] : state.campaigns) {
    if (lost.contains(id)) continue;
    if (!campaign.delivered.empty() || campaign.num_comparing > 0) return false;
  }
  return true;
}

bool is_quarantined(const State& state, const std::string& host) {
  return std::ranges::any_of(
      state.quarantined, [&](const auto& item) { return state.hosts.at(item.first).name == host; });
}

std::string runs_held_text(const State& state, WorkerId worker) {
  const auto found = state.workers.find(worker);
  if (found == state.workers.end()) return "none";
  std::string text;
  for (const auto& [id, set] : detail::leased_runs(state, found->second)) {
    if (!text.empty()) text += ' ';
    if (state.campaigns.size() > 1) text += state.campaigns.at(id).definition->name + ':';
    text += to_text(set);
  }
  return text.empty() ? "none" : text;
}

bool is_blamed(LossReason reason) {
  return reason == LossReason::crashed || reason == LossReason::out_of_memory ||
         reason == LossReason::hung;
}

double running_mean(double mean, double value) {
  constexpr double weight = 0.2;  // Of the newest value.
  return mean > 0.0 ? mean + weight * (value - mean) : value;
}

bool is_audited(std::uint64_t campaign_seed, RunIndex run, double fraction) {
  return fraction_of(mixed(mixed(campaign_seed) + run.value)) < fraction;
}

}  // namespace proofmass::coordinator
