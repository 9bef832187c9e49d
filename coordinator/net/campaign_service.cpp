#include "coordinator/net/campaign_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "coordinator/dispatch/events.hpp"
#include "core/error.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

std::optional<double> remaining_s(const CampaignState& campaign, double rate_hz) {
  if (campaign.phase != Phase::active || campaign.lent.empty() || rate_hz <= 0.0) return {};
  return static_cast<double>(campaign.definition->num_runs - num_settled(campaign)) / rate_hz;
}

}  // namespace

CampaignService::CampaignService(const ServiceContext& context)
    : context_(context),
      state_(context.state),
      writer_(context.writer),
      outbox_(context.outbox),
      files_(context.config.files) {}

CampaignService::~CampaignService() = default;

std::optional<CampaignRecord> CampaignService::find(std::string_view name) const {
  const auto has_name = [&](CampaignId id) {
    const auto served = served_.find(id);
    return (served == served_.end() ? closed_.at(id) : served->second.record).status.name() == name;
  };
  const auto found = std::ranges::find_if(order_, has_name);
  if (found == order_.end()) return std::nullopt;
  return record_of(*found);
}

std::vector<CampaignRecord> CampaignService::records(std::size_t first,
                                                     std::size_t count_max) const {
  std::vector<CampaignRecord> records;
  for (std::size_t i = first; i < order_.size() && records.size() < count_max; ++i) {
    records.push_back(record_of(order_[i]));
  }
  return records;
}

CampaignRecord CampaignService::record_of(CampaignId id) const {
  const auto closed = closed_.find(id);
  if (closed != closed_.end()) return closed->second;
  const CampaignState& campaign = state_.campaigns.at(id);
  const Served& served = served_.at(id);
  CampaignRecord record = served.record;
  record.num_waiting = campaign.delivered.size();
  proto::CampaignStatus& status = record.status;
  status.set_phase(wire::message_value(phase_of(id)));
  status.set_priority(campaign.priority);
  status.set_num_runs(campaign.definition->num_runs);
  status.set_num_done(campaign.committed.size());
  status.set_num_without_estimate(served.num_failures_before + campaign.num_without_estimate);
  status.set_num_given_up(campaign.given_up.size());
  status.set_num_suspects(campaign.suspects.size());
  status.set_num_lent(campaign.lent.runs().size());
  status.set_num_duplicates(campaign.num_duplicates);
  status.set_num_audited(campaign.num_audited);
  status.set_num_mismatches(campaign.num_mismatches);
  const bool is_computed = phase_of(id) == Phase::active;
  status.set_rate_hz(is_computed ? served.rate.rate_hz(context_.now()) : 0.0);
  const std::optional<double> left_s = remaining_s(campaign, status.rate_hz());
  if (left_s) status.set_remaining_s(*left_s);
  status.set_storage_failure(campaign.storage_failure);
  if (lacks_workers(state_, campaign)) {
    status.set_missing_model(campaign.model.version);
    status.set_model_refusal(campaign.model_refusal);
  }
  if (campaign.phase == Phase::cancelled && has_too_many_failures(campaign, served)) {
    status.set_failures_max(*served.plan.failures_max);
  }
  status.set_crashes_everywhere(crashes_everywhere(state_, campaign));
  return record;
}

CampaignService::Holdings CampaignService::holdings_of(std::string_view owner) const {
  Holdings holdings;
  for (const auto& [id, served] : served_) {
    if (served.record.status.owner() != owner) continue;
    const Holdings one = holdings_of(id);
    holdings.num_campaigns += one.num_campaigns;
    holdings.size += one.size;
  }
  return holdings;
}

CampaignService::Holdings CampaignService::holdings_of(CampaignId id) const {
  if (!served_.contains(id) || has_ended(phase_of(id))) return {};
  return {.num_campaigns = 1, .size = definition_size(*state_.campaigns.at(id).definition)};
}

bool CampaignService::change_held(CampaignId id, std::function<void()> change,
                                  std::function<void()> finish, Respond respond) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (!campaign.storage_failure.empty()) throw Error(campaign.storage_failure);
  Served& served = served_.at(id);
  if (served.is_held) {
    throw Error(fmt::format("campaign = {} (is being changed by another request; try again)",
                            served.record.status.name()));
  }
  served.is_held = context_.background.post(
      work_of(std::move(change), [this, id, finish = std::move(finish),
                                  respond = std::move(respond)](std::future<void> changed) {
        served_.at(id).is_held = false;
        respond_or_say_why(respond, [&] {
          changed.get();
          finish();
          respond(done_reply(id));
        });
      }));
  return served.is_held;
}

void CampaignService::change(CampaignId id, std::shared_ptr<const Campaign> definition,
                             const StopPlan& plan, const proto::SubmitRequest& wishes) {
  Served& served = served_.at(id);
  extend(id, std::move(definition));
  if (plan != served.plan) {
    served.plan = plan;
    served.is_decided = false;
  }
  const CampaignState& campaign = state_.campaigns.at(id);
  on_control(state_, id, wishes.has_priority() ? wishes.priority() : campaign.priority,
             wishes.has_audit_fraction() ? wishes.audit_fraction() : campaign.audit_fraction);
  on_resume(state_, id, context_.now(), outbox_);
  review();
}

void CampaignService::extend(CampaignId id, std::shared_ptr<const Campaign> definition) {
  if (definition->num_runs <= state_.campaigns.at(id).definition->num_runs) return;
  served_.at(id).is_decided = false;
  on_extended(state_, id, std::move(definition), context_.now(), outbox_);
}

CampaignControl CampaignService::control_now(CampaignId id) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  return {.phase = phase_of(id),
          .priority = campaign.priority,
          .audit_fraction = campaign.audit_fraction};
}

CampaignControl CampaignService::control_after(CampaignId id, proto::ControlAction action,
                                               int priority) const {
  CampaignControl control = control_now(id);
  const Phase phase = state_.campaigns.at(id).phase;
  if (action == proto::CONTROL_ACTION_SET_PRIORITY) control.priority = priority;
  if (action == proto::CONTROL_ACTION_PAUSE && phase == Phase::active)
    control.phase = Phase::paused;
  if (action == proto::CONTROL_ACTION_CANCEL && !has_ended(phase)) control.phase = Phase::cancelled;
  if (action == proto::CONTROL_ACTION_RESUME && phase != Phase::finished)
    control.phase = Phase::active;
  return control;
}

void CampaignService::control(CampaignId id, proto::ControlAction action,
                              const CampaignControl& stored) {
  const CampaignState& campaign = state_.campaigns.at(id);
  served_.at(id).written = stored;  // What happened meanwhile is written after it.
  switch (action) {
    case proto::CONTROL_ACTION_PAUSE:
      on_pause(state_, id, outbox_);
      break;
    case proto::CONTROL_ACTION_RESUME:
      on_resume(state_, id, context_.now(), outbox_);
      break;
    case proto::CONTROL_ACTION_CANCEL:
      on_cancel(state_, id, outbox_);
      break;
    case proto::CONTROL_ACTION_SET_PRIORITY:
      on_control(state_, id, stored.priority, campaign.audit_fraction);
      break;
    case proto::CONTROL_ACTION_RETRY:
      on_retry(state_, id, context_.now(), outbox_);
      break;
    default:
      PROOFMASS_EXPECT(false);  // See archive().
  }
  review();
}

bool CampaignService::is_undecided(CampaignId id) const {
  const Served& served = served_.at(id);
  return state_.campaigns.at(id).phase == Phase::finished && !served.plan.stop_rule.empty() &&
         !served.is_decided;
}

Phase CampaignService::phase_of(CampaignId id) const {
  const CampaignState& campaign = state_.campaigns.at(id);
  const bool is_more_to_come = is_undecided(id) || !campaign.elsewhere.empty();
  if (campaign.phase == Phase::finished && is_more_to_come) return Phase::active;
  return campaign.phase;
}

void CampaignService::review() {
  const TimePoint now = context_.now();
  std::vector<CampaignId> ended;
  for (auto& [id, served] : served_) {
    const CampaignState& campaign = state_.campaigns.at(id);
    // A result that a worker had finished while it was cut off says nothing of the time since then.
    const std::uint64_t num_computed = campaign.num_committed_here - campaign.num_kept;
    const std::uint64_t num_new = num_computed - served.num_computed_seen;
    served.num_computed_seen = num_computed;
    if (num_new > 0 || !campaign.lent.empty()) {
      served.rate.add(num_new, now);
    } else {
      served.rate.wait(now);
    }
    review_failures(id, served);
    review_summary(id, served);
    review_control(id, served);
    review_rest(id, served);
    review_notices(id, served);
    if (!is_finished_and_settled(id, served)) {
      served.ended_at.reset();
    } else {
      if (!served.ended_at) served.ended_at = now;
      ended.push_back(id);
    }
  }
  close_surplus(std::move(ended), now);
}

std::uint64_t CampaignService::num_failures_of(const CampaignState& campaign,
                                               const Served& served) {
  return served.num_failures_before + campaign.num_without_estimate + campaign.given_up.size();
}

bool CampaignService::has_too_many_failures(const CampaignState& campaign, const Served& served) {
  const std::optional<std::uint64_t>& failures_max = served.plan.failures_max;
  return failures_max && num_failures_of(campaign, served) > *failures_max;
}

void CampaignService::review_failures(CampaignId id, const Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (campaign.phase != Phase::active && campaign.phase != Phase::paused) return;
  if (!has_too_many_failures(campaign, served)) return;
  const std::uint64_t num_failures = num_failures_of(campaign, served);
  on_cancel(state_, id, outbox_);
  tell(served, fmt::format("{} runs have no estimate (at most {} may be)", num_failures,
                           *served.plan.failures_max));
  outbox_.log(Event::error("too_many_failures", {{"without_estimate", num_failures},
                                                 {"failures_max", *served.plan.failures_max}}),
              id);
}

void CampaignService::review_control(CampaignId id, Served& served) {
  const CampaignControl control = control_now(id);
  if (control == served.written) return;
  writer_.write(id, control);
  served.written = control;
}

CampaignService::Counts CampaignService::counts_of(const CampaignState& campaign) {
  return {campaign.num_committed_here, campaign.given_up.size()};
}

bool CampaignService::lacks_summary(CampaignId id, const Served& served) const {
  if (files_ == nullptr || !has_ended(phase_of(id))) return false;
  return served.is_summary_due || served.summarised != counts_of(state_.campaigns.at(id));
}

bool CampaignService::awaits_summary(CampaignId id) const {
  const auto found = served_.find(id);
  if (found == served_.end()) return false;
  const Served& served = found->second;
  const bool has_failed =
      !served.summary_failure.empty() || !state_.campaigns.at(id).storage_failure.empty();
  return !has_failed && (served.summary.valid() || lacks_summary(id, served));
}

void CampaignService::review_summary(CampaignId id, Served& served) {
  if (served.summary.valid()) {
    if (served.summary.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    take_summary(id, served);
  }
  if (served.is_held || served.is_abandoned || context_.now() < served.summary_after) return;
  // What waits for the disk when a campaign is cancelled belongs to it.
  const bool is_due = lacks_summary(id, served) && state_.campaigns.at(id).delivered.empty();
  if (is_due || is_undecided(id)) begin_summary(id, served);
}

void CampaignService::take_summary(CampaignId id, Served& served) {
  std::optional<std::uint64_t> num_runs;
  const std::string failure = failure_of([&] { num_runs = served.summary.get(); });
  const CampaignState& campaign = state_.campaigns.at(id);
  const bool is_finished_now = campaign.phase == Phase::finished;
  // A check that failed, asks for runs that are not there yet, or was of fewer, is made again.
  served.is_decided = failure.empty() && !num_runs && is_finished_now && served.is_of_all &&
                      served.summarised == counts_of(campaign);
  const bool is_news = failure != std::exchange(served.summary_failure, failure);
  if (!failure.empty()) {
    served.is_summary_due = true;
    served.summary_after = context_.now() + context_.config.writer.retry_after;
    if (!is_news) return;
    outbox_.log(Event::error("statistics_failed", {Field::reason(failure)}), id);
    return;
  }
  wire::Fields fields{{"runs", num_settled(campaign)}};
  if (num_runs) fields.emplace_back("next", *num_runs);
  if (served.extension_failure.empty()) {
    outbox_.log(Event::info("campaign_summarised", std::move(fields)), id);
  }
  if (num_runs && !served.is_held && is_finished_now) go_on_to(id, *num_runs);
}

void CampaignService::go_on_to(CampaignId id, std::uint64_t num_runs) {
  served_.at(id).is_held = true;
  std::unique_ptr<Campaign> wanted = state_.campaigns.at(id).definition->clone();
  wanted->num_runs = num_runs;
  auto extend_file = [this, id, wanted = std::move(wanted)] {
    std::shared_ptr<const Campaign> extended;
    writer_.access(id, [&](Store& store) { extended = files_->extend(store, *wanted); });
    return extended;
  };
  context_.background.post_next(work_of(
      std::move(extend_file),
      [this, id, num_runs](std::future<std::shared_ptr<const Campaign>> got) {
        Served& served = served_.at(id);
        served.is_held = false;
        std::shared_ptr<const Campaign> extended;
        const std::string failure = failure_of([&] { extended = got.get(); });
        const bool is_news = failure != std::exchange(served.extension_failure, failure);
        if (extended != nullptr) return extend(id, extended);
        served.summary_after = context_.now() + context_.config.writer.retry_after;
        if (!is_news) return;
        outbox_.log(
            Event::error("campaign_not_extended", {{"runs", num_runs}, Field::reason(failure)}),
            id);
      }));
}

void CampaignService::begin_summary(CampaignId id, Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  served.is_summary_due = false;
  served.is_of_all = campaign.phase == Phase::finished;
  served.summarised = counts_of(campaign);
  served.summary = std::async(
      std::launch::async, [this, id, file = served.record.file, definition = campaign.definition] {
        writer_.access(id, [](Store&) {});  // Runs that were given up just now are in the file.
        const auto write = [&](const std::function<void(Store&)>& action) {
          writer_.access(id, action);
        };
        return files_->summarise(file, *definition, write);
      });
}

void CampaignService::review_notices(CampaignId id, Served& served) {
  const CampaignState& campaign = state_.campaigns.at(id);
  if (phase_of(id) == Phase::active) served.is_end_told = false;
  if (!served.is_end_told && is_finished_and_settled(id, served)) {
    served.is_end_told = true;
    const bool has_failed = wire::has_failed(record_of(id).status);
    tell(served, has_failed ? "most of its runs were given up" : "");
  }
  std::string trouble = campaign.storage_failure;
  if (trouble.empty() && campaign.num_mismatches > 0) {
    trouble =
        fmt::format("{} runs were computed again with another result", campaign.num_mismatches);
  }
  if (!trouble.empty() && trouble != served.trouble_told) tell(served, trouble);
  served.trouble_told = std::move(trouble);
}

void CampaignService::tell(const Served& served, std::string failure) const {
  if (!context_.config.on_notice) return;
  context_.config.on_notice({.campaign = served.record.status.name(),
                             .file = served.record.file,
                             .failure = std::move(failure)});
}

bool CampaignService::is_all_done() const {
  return std::all_of(state_.campaigns.begin(), state_.campaigns.end(), [&](const auto& item) {
    const auto& [id, campaign] = item;
    return campaign.phase == Phase::cancelled || (is_finished(campaign) && !is_undecided(id)) ||
           served_.at(id).is_abandoned;
  });
}

bool CampaignService::is_all_told() const {
  if (!context_.config.on_notice) return true;
  return std::ranges::all_of(served_, [&](const auto& item) {
    const auto& [id, served] = item;
    return phase_of(id) != Phase::finished || served.is_end_told ||
           !served.summary_failure.empty() || !state_.campaigns.at(id).storage_failure.empty();
  });
}

proto::ReplyEnvelope CampaignService::done_reply(CampaignId id) const {
  const proto::CampaignStatus status = record_of(id).status;
  return wire::done_reply(fmt::format("campaign {}: {}, {} runs, {} of them done", status.name(),
                                      wire::phase_name(status), status.num_runs(),
                                      status.num_done()));
}

}  // namespace proofmass::coordinator
