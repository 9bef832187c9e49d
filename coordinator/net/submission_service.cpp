#include "coordinator/net/submission_service.hpp"

#include <fmt/format.h>

#include <exception>
#include <optional>
#include <utility>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

using Submitted = std::shared_ptr<const Submission>;

StopPlan plan_of(const Submission& request) {
  StopPlan plan{
      .stop_rule = request.stop_rule, .num_runs_max = {}, .failures_max = request.failures_max};
  if (!plan.stop_rule.empty()) plan.num_runs_max = request.campaign->num_runs;
  return plan;
}

void write(Store& store, const Entry& entry) { (void)store.write({&entry, 1}); }

[[noreturn]] void refuse_as_too_many() {
  throw Error(fmt::format("requests = {} (are under way, as many as may be; try again later)",
                          Background::num_pending_max));
}

}  // namespace

SubmissionService::SubmissionService(Surroundings surroundings)
    : surroundings_(std::move(surroundings)), campaigns_(surroundings_.campaigns) {}

void SubmissionService::submit(const Submitted& request, const Asker& asker, Respond respond) {
  const std::string& name = request->campaign->name;
  if (surroundings_.files == nullptr) {
    throw Error(fmt::format(
        "submit = {} (this coordinator serves the campaigns that it began with)", name));
  }
  const std::optional<CampaignService::Entry> entry = campaigns_.find(name);
  if (entry) {
    require_control(asker, name, entry->owner);
  } else {
    require_right(asker, Right::submit);
  }
  if (is_busy(name)) {
    if (deferred_.size() == Background::num_pending_max) refuse_as_too_many();
    deferred_.push_back({.request = request, .asker = asker, .respond = std::move(respond)});
    return;
  }
  const std::string& owner = entry ? entry->owner : asker.name;
  check_limits(owner, definition_size(*request->campaign), !entry || entry->has_ended);
  if (entry && !entry->has_ended) {
    change_served(entry->id, request, std::move(respond));
  } else {
    open_file(request, asker, owner, std::move(respond));
  }
}

bool SubmissionService::is_busy(const std::string& name) const {
  if (under_way_.contains(name)) return true;
  const std::optional<CampaignService::Entry> entry = campaigns_.find(name);
  return entry && !entry->has_ended && campaigns_.is_held(entry->id);
}

void SubmissionService::review() {
  for (const Deferred& waiting : std::exchange(deferred_, {})) {
    try {
      submit(waiting.request, waiting.asker, waiting.respond);
    } catch (const std::exception& error) {
      waiting.respond(wire::ErrorReply{error.what()});
    }
  }
}

// Files without an owner, and all files of a coordinator without keys, are not limited: a client
// that can reach it can fill its disk in other ways.
void SubmissionService::check_limits(const std::string& owner, std::uint64_t size,
                                     bool is_new) const {
  if (owner.empty() || !is_new) return;
  CampaignService::Holdings holdings = campaigns_.holdings_of(owner);
  for (const auto& [name, under_way] : under_way_) {
    if (under_way.owner != owner) continue;
    ++holdings.num_campaigns;
    holdings.size += under_way.size;
  }
  const auto& [campaigns_max, size_max] = surroundings_.limits;
  if (holdings.num_campaigns >= campaigns_max) {
    throw Error(fmt::format("campaigns = {} (must be at most {} unfinished ones of the key {})",
                            holdings.num_campaigns + 1, campaigns_max, owner));
  }
  if (holdings.size + size > size_max) {
    throw Error(fmt::format(
        "definitions size = {} bytes (must be at most {} of the unfinished campaigns of the key "
        "{})",
        holdings.size + size, size_max, owner));
  }
}

void SubmissionService::open_file(const Submitted& request, const Asker& asker,
                                  const std::string& owner, Respond respond) {
  CampaignFiles& files = *surroundings_.files;
  serve_opened(
      request->campaign->name, {.owner = owner, .size = definition_size(*request->campaign)},
      [&files, request, asker] { return files.open(*request->campaign, plan_of(*request), asker); },
      [request](Store& store) {
        const CampaignControl control = store.control();
        write(store, CampaignControl{.phase = Phase::active,
                                     .priority = request->priority.value_or(control.priority),
                                     .audit_fraction =
                                         request->audit_fraction.value_or(control.audit_fraction)});
      },
      std::move(respond));
}

void SubmissionService::reopen(const CampaignService::Entry& campaign, wire::ControlAction action,
                               Respond respond) {
  const wire::CampaignStatus status = campaigns_.status_of(campaign.id);
  if (under_way_.contains(status.name)) {
    throw Error(
        fmt::format("campaign = {} (another request for it is under way; try again)", status.name));
  }
  const CampaignDirectory& directory = *surroundings_.directory;
  serve_opened(
      status.name, {.owner = campaign.owner},
      [&directory, file = campaign.file] { return directory.load(file); },
      [action](Store& store) {
        if (action == wire::ControlAction::retry) write(store, RetriedRuns{});
        CampaignControl control = store.control();
        control.phase = Phase::active;
        write(store, control);
      },
      std::move(respond));
}

void SubmissionService::serve_opened(const std::string& name, UnderWay under_way,
                                     std::function<ServedCampaign()> open,
                                     std::function<void(Store&)> activate, Respond respond) {
  const auto work = [this, name, open = std::move(open), activate = std::move(activate),
                     respond]() -> Background::Finish {
    // Copyable, as the function is.
    const auto prepared = std::make_shared<std::optional<PreparedCampaign>>();
    std::string failure;
    try {
      ServedCampaign campaign = open();
      activate(campaign.store);
      *prepared = prepare(std::move(campaign), GivenUpRuns::keep, surroundings_.start);
    } catch (const std::exception& error) {
      prepared->reset();
      failure = error.what();
    }
    return [this, name, prepared, failure, respond] {
      under_way_.erase(name);
      if (!*prepared) return respond(wire::ErrorReply{failure});
      const CampaignId id = (*prepared)->campaign.store.id();
      campaigns_.serve(std::move(**prepared));
      campaigns_.review();
      respond(campaigns_.done_reply(id));
    };
  };
  if (!surroundings_.background.post(work)) refuse_as_too_many();
  under_way_.emplace(name, std::move(under_way));
}

void SubmissionService::change_served(CampaignId id, const Submitted& request, Respond respond) {
  const StopPlan plan = plan_of(*request);
  const std::uint64_t num_runs =
      horizon_of(plan, request->campaign->num_runs, campaigns_.num_runs_of(id));
  const bool has_new_plan = plan != campaigns_.plan_of(id);
  campaigns_.take_hold(id);
  const auto work = [this, id, request, plan, num_runs, has_new_plan, respond,
                     file = campaigns_.file_of(id)]() -> Background::Finish {
    CampaignService::Change change{.definition = nullptr,
                                   .plan = plan,
                                   .priority = request->priority,
                                   .audit_fraction = request->audit_fraction};
    std::string failure;
    try {
      const std::unique_ptr<Campaign> wanted = request->campaign->clone();
      wanted->num_runs = num_runs;
      surroundings_.files->require_same(file, *wanted);
      surroundings_.writer.access(id, [&](Store& store) {
        change.definition = surroundings_.files->extend(store, *wanted);
        if (has_new_plan) store.set_stop_plan(plan);
      });
    } catch (const std::exception& error) {
      failure = error.what();
    }
    return [this, id, change, failure, respond] {
      if (!failure.empty()) {
        campaigns_.let_go(id);
        return respond(wire::ErrorReply{failure});
      }
      campaigns_.change(id, change);
      respond(campaigns_.done_reply(id));
    };
  };
  if (surroundings_.background.post(work)) return;
  campaigns_.let_go(id);
  refuse_as_too_many();
}

}  // namespace proofmass::coordinator
