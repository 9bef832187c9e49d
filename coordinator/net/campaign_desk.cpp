#include "coordinator/net/campaign_desk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <type_traits>
#include <utility>
#include <variant>

#include "coordinator/dispatch/dispatch.hpp"
#include "core/error.hpp"
#include "core/simulation/run.hpp"
#include "proto/link/faults.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

using wire::CampaignPhase;

CampaignPhase phase_of(Phase phase) {
  switch (phase) {
    case Phase::active:
      return CampaignPhase::active;
    case Phase::paused:
      return CampaignPhase::paused;
    case Phase::finished:
      return CampaignPhase::finished;
    case Phase::cancelled:
      return CampaignPhase::cancelled;
  }
  PROOFMASS_EXPECT(false);
}

Phase phase_of(CampaignPhase phase) {
  switch (phase) {
    case CampaignPhase::active:
      return Phase::active;
    case CampaignPhase::paused:
      return Phase::paused;
    case CampaignPhase::finished:
      return Phase::finished;
    case CampaignPhase::cancelled:
      return Phase::cancelled;
  }
  PROOFMASS_EXPECT(false);
}

CampaignControl control_of(const CampaignState& campaign) {
  return {.phase = phase_of(campaign.phase),
          .priority = campaign.priority,
          .audit_fraction = campaign.audit_fraction};
}

StoredCampaign stored_campaign_of(const ServedCampaign& campaign, GivenUpRuns given_up) {
  const Store& store = campaign.store;
  const CampaignControl control = store.control();
  StoredCampaign stored{.definition = campaign.definition,
                        .phase = phase_of(control.phase),
                        .priority = control.priority,
                        .audit_fraction = control.audit_fraction,
                        .finished = store.finished_runs(),
                        .given_up = {},
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
    extend(*id, request.campaign, now, outbox);
    resume(*id, now, outbox);
  } else {
    ServedCampaign campaign = files_->open(request.campaign);
    const Entry control = CampaignControl{.phase = CampaignPhase::active,
                                          .priority = request.priority,
                                          .audit_fraction = request.audit_fraction};
    (void)campaign.store.write({&control, 1});
    id = campaign.store.id();
    serve(std::move(campaign), GivenUpRuns::keep, now, outbox);
  }
  review(now, outbox);
  return done_reply(*id);
}

void CampaignDesk::resume(CampaignId id, TimePoint now, Outbox& outbox) {
  const Phase phase = state_.campaigns.at(id).phase;
  if (phase == Phase::paused || phase == Phase::cancelled) on_resume(state_, id, now, outbox);
}

void CampaignDesk::extend(CampaignId id, const Campaign& wanted, TimePoint now, Outbox& outbox) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (!campaign.storage_failure.empty()) throw Error(campaign.storage_failure);
  std::shared_ptr<const Campaign> extended;
  writer_.access(id, [&](Store& store) { extended = files_->extend(store, wanted); });
  if (extended->num_runs == campaign.definition->num_runs) return;
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
         .host = worker.host,
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
          .phase = phase_of(campaign.phase),
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

void CampaignDesk::review(TimePoint now, Outbox& outbox) {
  for (auto& [id, served] : served_) {
    const CampaignState& campaign = state_.campaigns.at(id);
    const std::uint64_t num_committed = campaign.num_committed_here;
    if (num_committed > served.num_committed_seen) {
      served.rate.add(num_committed - served.num_committed_seen, now);
      served.num_committed_seen = num_committed;
    }
    const CampaignControl control = control_of(campaign);
    if (control != served.written) {
      writer_.set_control(id, control);
      if (control.phase == CampaignPhase::finished) served.is_summary_due = files_ != nullptr;
      served.written = control;
    }
    review_summary(id, served, outbox);
  }
}

void CampaignDesk::review_summary(CampaignId id, Served& served, Outbox& outbox) {
  if (served.summary.valid()) {
    if (served.summary.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    const std::string failure = served.summary.get();
    if (failure.empty()) {
      outbox.log({.kind = "campaign_summarised", .text = "", .campaign = id});
    } else {
      outbox.log({.severity = Severity::error,
                  .kind = "statistics_failed",
                  .text = fmt::format("reason=\"{}\"", failure),
                  .campaign = id});
    }
  }
  if (!std::exchange(served.is_summary_due, false)) return;
  served.num_summarised = state_.campaigns.at(id).num_committed_here;
  served.summary = std::async(
      std::launch::async,
      [this, id, file = served.file, definition = state_.campaigns.at(id).definition] {
        try {
          files_->summarise(
              file, definition->scenario,
              [&](const std::function<void(Store&)>& action) { writer_.access(id, action); });
          return std::string();
        } catch (const std::exception& error) {
          return std::string(error.what());
        }
      });
}

bool CampaignDesk::is_all_done() const {
  return std::all_of(state_.campaigns.begin(), state_.campaigns.end(), [](const auto& item) {
    return item.second.phase == Phase::cancelled || is_finished(item.second);
  });
}

std::vector<ServedCampaign> CampaignDesk::close() {
  std::vector<ServedCampaign> campaigns;
  for (const CampaignId id : state_.order) {
    Served& served = served_.at(id);
    if (served.summary.valid()) served.summary.wait();
    Store store = writer_.close(id);
    store.end_coordinator(start_.epoch);
    const CampaignState& campaign = state_.campaigns.at(id);
    campaigns.push_back({.file = served.file,
                         .store = std::move(store),
                         .definition = campaign.definition,
                         .has_new_results = campaign.num_committed_here > served.num_summarised});
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
                              campaign.definition->name, wire::name_of(phase_of(campaign.phase)),
                              campaign.definition->num_runs, campaign.committed.size())};
}

}  // namespace proofmass::coordinator
