#include "coordinator/net/campaign_desk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <type_traits>
#include <utility>
#include <variant>

#include "coordinator/dispatch/dispatch.hpp"
#include "coordinator/store/store_error.hpp"
#include "core/error.hpp"
#include "core/simulation/run.hpp"
#include "proto/link/faults.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

StopPlan plan_of(const wire::SubmitRequest& request) {
  StopPlan plan{
      .stop_rule = request.stop_rule, .num_runs_max = {}, .failures_max = request.failures_max};
  if (!plan.stop_rule.empty()) plan.num_runs_max = request.campaign.num_runs;
  return plan;
}

StoredCampaign stored_campaign_of(const ServedCampaign& campaign, GivenUpRuns given_up) {
  const Store& store = campaign.store;
  const CampaignControl control = store.control();
  StoredCampaign stored{.definition = campaign.definition,
                        .phase = control.phase,
                        .priority = control.priority,
                        .audit_fraction = control.audit_fraction,
                        .finished = store.finished_runs(),
                        .given_up = {},
                        .compared = store.compared_runs(),
                        .blamed = {}};
  if (given_up == GivenUpRuns::retry) return stored;
  stored.given_up = store.given_up_runs();
  for (const BlamedRun& blamed : store.blamed_runs()) {
    stored.blamed.push_back(
        {.run = blamed.run, .num_crashes = blamed.num_crashes, .attempt = blamed.attempt});
  }
  return stored;
}

std::optional<double> remaining_s(const CampaignState& campaign, double rate_hz) {
  if (campaign.phase != Phase::active || rate_hz <= 0.0) return std::nullopt;
  const std::uint64_t num_ended = campaign.committed.size() + campaign.given_up.size();
  return static_cast<double>(campaign.definition->num_runs - num_ended) / rate_hz;
}

}  // namespace

CampaignDesk::CampaignDesk(State& state, StoreWriter& writer, CampaignFiles* files,
                           CoordinatorStart start, TimePoint now)
    : state_(state), writer_(writer), files_(files), start_(std::move(start)), began_at_(now) {}

CampaignDesk::~CampaignDesk() = default;

void CampaignDesk::serve(ServedCampaign campaign, GivenUpRuns given_up, TimePoint now,
                         Outbox& outbox) {
  const CampaignId id = campaign.store.id();
  if (find(campaign.definition->name) || served_.contains(id)) {
    throw Error(fmt::format("campaign = {} in {} (is served already, from another file)",
                            campaign.definition->name, campaign.file.string()));
  }
  wire::kill_point(wire::KillPoint::after_open);
  const StoredCampaign stored = stored_campaign_of(campaign, given_up);
  campaign.store.begin_coordinator(start_);
  served_.emplace(id, Served{.file = campaign.file,
                             .name = campaign.definition->name,
                             .rate = RateMeter(now),
                             .written = campaign.store.control(),
                             .plan = campaign.store.stop_plan(),
                             .is_decided = campaign.store.control().phase == Phase::finished,
                             .num_failures_before = campaign.store.num_without_estimate(),
                             .summary = {}});
  writer_.open(id, std::move(campaign.store));
  on_campaign(state_, id, stored, now, outbox);
}

wire::ClientReply CampaignDesk::answer(const wire::ClientRequest& request, TimePoint now,
                                       Outbox& outbox) {
  try {
    return std::visit([&](const auto& content) { return carry_out(content, now, outbox); },
                      request);
  } catch (const Error& error) {
    return wire::ErrorReply{.text = error.what()};
  }
}

wire::ClientReply CampaignDesk::carry_out(const wire::SubmitRequest& request, TimePoint now,
                                          Outbox& outbox) {
  if (files_ == nullptr) {
    return wire::ErrorReply{
        fmt::format("submit = {} (this coordinator serves the campaigns that "
                    "it began with)",
                    request.campaign.name)};
  }
  auto id = find(request.campaign.name);
  if (id) {
    resubmit(*id, request, now, outbox);
  } else {
    ServedCampaign campaign = files_->open(request.campaign, plan_of(request));
    const Entry control = CampaignControl{.phase = Phase::active,
                                          .priority = request.priority,
                                          .audit_fraction = request.audit_fraction};
    (void)campaign.store.write({&control, 1});
    id = campaign.store.id();
    serve(std::move(campaign), GivenUpRuns::keep, now, outbox);
  }
  review(now, outbox);
  return done_reply(*id);
}

void CampaignDesk::resubmit(CampaignId id, const wire::SubmitRequest& request, TimePoint now,
                            Outbox& outbox) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (!campaign.storage_failure.empty()) throw Error(campaign.storage_failure);
  const StopPlan plan = plan_of(request);
  Campaign wanted = request.campaign;
  wanted.num_runs = horizon_of(plan, wanted.num_runs, campaign.definition->num_runs);
  extend(id, wanted, now, outbox);
  Served& served = served_.at(id);
  if (plan != served.plan) {
    writer_.access(id, [&](Store& store) { store.set_stop_plan(plan); });
    served.plan = plan;
    served.is_decided = false;
  }
  on_control(state_, id, request.priority, request.audit_fraction);
  resume(id, now, outbox);
}

void CampaignDesk::resume(CampaignId id, TimePoint now, Outbox& outbox) {
  const Phase phase = state_.campaigns.at(id).phase;
  if (phase == Phase::paused || phase == Phase::cancelled) on_resume(state_, id, now, outbox);
}

void CampaignDesk::extend(CampaignId id, const Campaign& wanted, TimePoint now, Outbox& outbox) {
  std::shared_ptr<const Campaign> extended;
  writer_.access(id, [&](Store& store) { extended = files_->extend(store, wanted); });
  if (extended->num_runs == state_.campaigns.at(id).definition->num_runs) return;
  served_.at(id).is_decided = false;
  on_extended(state_, id, std::move(extended), now, outbox);
}

wire::ClientReply CampaignDesk::carry_out(const wire::ControlRequest& request, TimePoint now,
                                          Outbox& outbox) {
  const auto id = find(request.campaign);
  if (!id) return wire::ErrorReply{fmt::format("campaign = {} (is not served)", request.campaign)};
  if (state_.campaigns.at(*id).phase == Phase::finished) {
    return wire::ErrorReply{fmt::format("campaign = {} (is finished)", request.campaign)};
  }
  switch (request.action) {
    case wire::ControlAction::pause:
      on_pause(state_, *id, outbox);
      break;
    case wire::ControlAction::resume:
      resume(*id, now, outbox);
      break;
    case wire::ControlAction::cancel:
      on_cancel(state_, *id, outbox);
      break;
  }
  review(now, outbox);
  return done_reply(*id);
}

wire::ClientReply CampaignDesk::carry_out(const wire::StatusRequest&, TimePoint now, Outbox&) {
  wire::StatusReply reply{.version = start_.version,
                          .model_version = std::string(model_version),
                          .uptime_s = std::chrono::duration<double>(now - began_at_).count(),
                          .num_workers = state_.workers.size(),
                          .campaigns = {}};
  for (const auto& [id, worker] : state_.workers) reply.num_slots += worker.num_slots;
  for (const CampaignId id : state_.order) {
    if (reply.campaigns.size() == wire::campaigns_per_reply_max) break;
    reply.campaigns.push_back(status_of(id, now));
  }
  return reply;
}

wire::ClientReply CampaignDesk::carry_out(const wire::WorkersRequest&, TimePoint now, Outbox&) {
  wire::WorkersReply reply;
  for (const auto& [id, worker] : state_.workers) {
    if (reply.workers.size() == wire::workers_per_reply_max) break;
    reply.workers.push_back(
        {.id = id,
         .name = worker.name,
         .host = worker.host.name,
         .process_id = worker.process_id,
         .num_slots = worker.num_slots,
         .num_lent = worker.num_lent,
         .num_results = worker.num_results,
         .silent_s = std::chrono::duration<double>(now - worker.heard_at).count(),
         .is_quarantined = state_.quarantined.contains(worker.host)});
  }
  return reply;
}

wire::CampaignStatus CampaignDesk::status_of(CampaignId id, TimePoint now) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  const Served& served = served_.at(id);
  const double rate_hz = served.rate.rate_hz(now);
  return {.name = served.name,
          .phase = phase_of(id),
          .priority = campaign.priority,
          .num_runs = campaign.definition->num_runs,
          .num_done = campaign.committed.size(),
          .num_without_estimate = campaign.num_without_estimate,
          .num_given_up = campaign.given_up.size(),
          .num_lent = campaign.lent.size(),
          .num_duplicates = campaign.num_duplicates,
          .num_audited = campaign.num_audited,
          .num_mismatches = campaign.num_mismatches,
          .rate_hz = rate_hz,
          .remaining_s = remaining_s(campaign, rate_hz),
          .storage_failure = campaign.storage_failure};
}

Phase CampaignDesk::phase_of(CampaignId id) const {
  const Phase phase = state_.campaigns.at(id).phase;
  const Served& served = served_.at(id);
  const bool is_undecided = !served.plan.stop_rule.empty() && !served.is_decided;
  if (phase == Phase::finished && is_undecided) return Phase::active;
  return phase;
}

void CampaignDesk::review(TimePoint now, Outbox& outbox) {
  for (auto& [id, served] : served_) {
    const CampaignState& campaign = state_.campaigns.at(id);
    const std::uint64_t num_committed = campaign.num_committed_here;
    if (num_committed > served.num_committed_seen) {
      served.rate.add(num_committed - served.num_committed_seen, now);
      served.num_committed_seen = num_committed;
    }
    review_failures(id, served, outbox);
    review_summary(id, served, now, outbox);
    review_control(id, served);
  }
}

void CampaignDesk::review_failures(CampaignId id, const Served& served, Outbox& outbox) {
  if (!served.plan.failures_max) return;
  const CampaignState& campaign = state_.campaigns.at(id);
  if (campaign.phase != Phase::active && campaign.phase != Phase::paused) return;
  const std::uint64_t num_failures =
      served.num_failures_before + campaign.num_without_estimate + campaign.given_up.size();
  if (num_failures <= *served.plan.failures_max) return;
  on_cancel(state_, id, outbox);
  outbox.log({.severity = Severity::error,
              .kind = "too_many_failures",
              .text = fmt::format("without_estimate={} failures_max={}", num_failures,
                                  *served.plan.failures_max),
              .campaign = id});
}

void CampaignDesk::review_control(CampaignId id, Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  const CampaignControl control{.phase = phase_of(id),
                                .priority = campaign.priority,
                                .audit_fraction = campaign.audit_fraction};
  if (control == served.written) return;
  writer_.set_control(id, control);
  const bool has_new_results = served.num_summarised != campaign.num_committed_here;
  if (control.phase == Phase::finished && has_new_results) {
    served.is_summary_due = files_ != nullptr;
  }
  served.written = control;
}

void CampaignDesk::review_summary(CampaignId id, Served& served, TimePoint now, Outbox& outbox) {
  if (served.summary.valid()) {
    if (served.summary.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    take_summary(id, served, now, outbox);
  }
  const bool is_finished = state_.campaigns.at(id).phase == Phase::finished;
  const bool is_undecided = is_finished && phase_of(id) != Phase::finished;
  const bool is_due = std::exchange(served.is_summary_due, false);
  if (is_due || is_undecided) begin_summary(id, served);
}

void CampaignDesk::take_summary(CampaignId id, Served& served, TimePoint now, Outbox& outbox) {
  const auto [failure, num_runs] = served.summary.get();
  const Campaign& definition = *state_.campaigns.at(id).definition;
  // A rule that cannot be checked stops: nobody knows how much further it would go.
  served.is_decided = true;
  if (!failure.empty()) {
    outbox.log({.severity = Severity::error,
                .kind = "statistics_failed",
                .text = fmt::format("reason=\"{}\"", failure),
                .campaign = id});
    return;
  }
  outbox.log({.kind = "campaign_summarised",
              .text = num_runs ? fmt::format("runs={} next={}", definition.num_runs, *num_runs)
                               : fmt::format("runs={}", definition.num_runs),
              .campaign = id});
  if (num_runs && state_.campaigns.at(id).phase == Phase::finished) {
    go_on_to(id, *num_runs, now, outbox);
  }
}

void CampaignDesk::go_on_to(CampaignId id, std::uint64_t num_runs, TimePoint now, Outbox& outbox) {
  Campaign wanted = *state_.campaigns.at(id).definition;
  wanted.num_runs = num_runs;
  try {
    extend(id, wanted, now, outbox);
  } catch (const Error& error) {
    outbox.log({.severity = Severity::error,
                .kind = "campaign_not_extended",
                .text = fmt::format("runs={} reason=\"{}\"", num_runs, error.what()),
                .campaign = id});
  }
}

void CampaignDesk::begin_summary(CampaignId id, Served& served) {
  served.num_summarised = state_.campaigns.at(id).num_committed_here;
  served.summary = std::async(
      std::launch::async,
      [this, id, file = served.file, definition = state_.campaigns.at(id).definition] {
        try {
          return Summarised{
              .failure = {},
              .num_runs = files_->summarise(
                  file, definition->scenario,
                  [&](const std::function<void(Store&)>& action) { writer_.access(id, action); })};
        } catch (const std::exception& error) {
          return Summarised{.failure = error.what(), .num_runs = {}};
        }
      });
}

bool CampaignDesk::is_all_done() const {
  return std::all_of(state_.campaigns.begin(), state_.campaigns.end(), [&](const auto& item) {
    const auto& [id, campaign] = item;
    const bool is_undecided = campaign.phase == Phase::finished && phase_of(id) != Phase::finished;
    return campaign.phase == Phase::cancelled || (is_finished(campaign) && !is_undecided);
  });
}

std::vector<ServedCampaign> CampaignDesk::close() {
  std::vector<ServedCampaign> campaigns;
  for (const CampaignId id : state_.order) {
    Served& served = served_.at(id);
    if (served.summary.valid()) served.summary.wait();
    Store store = writer_.close(id);
    try {
      store.end_coordinator(start_.epoch);
    } catch (const StoreError&) {
      // A file that cannot be written now looks as after a kill, and the campaigns are given back.
    }
    const CampaignState& campaign = state_.campaigns.at(id);
    campaigns.push_back(
        {.file = served.file, .store = std::move(store), .definition = campaign.definition});
  }
  served_.clear();
  return campaigns;
}

std::optional<CampaignId> CampaignDesk::find(std::string_view name) const {
  for (const auto& [id, served] : served_) {
    if (served.name == name) return id;
  }
  return std::nullopt;
}

wire::DoneReply CampaignDesk::done_reply(CampaignId id) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  return {.text = fmt::format("campaign {}: {}, {} runs, {} of them done",
                              campaign.definition->name, wire::name_of(phase_of(id)),
                              campaign.definition->num_runs, campaign.committed.size())};
}

}  // namespace proofmass::coordinator
