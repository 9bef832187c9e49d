#include "coordinator/net/request_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

#include "coordinator/net/service_sockets.hpp"
#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/records.hpp"
#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

/// @throws Error if the action can have no effect. A finished campaign can only be archived or
/// retried, the latter only if runs were given up; a cancelled one must be resumed before it is
/// retried, paused or gets a priority; one that is neither cannot be archived.
void require_possible(const proto::CampaignStatus& campaign, proto::ControlAction action) {
  const auto refuse = [&](std::string_view why) {
    throw Error(fmt::format("campaign = {} ({})", campaign.name(), why));
  };
  const bool is_retry = action == proto::CONTROL_ACTION_RETRY;
  const bool needs_resume = is_retry || action == proto::CONTROL_ACTION_SET_PRIORITY ||
                            action == proto::CONTROL_ACTION_PAUSE;
  if (action == proto::CONTROL_ACTION_ARCHIVE) {
    if (!has_ended(wire::phase_of(campaign))) refuse("is not finished; cancel it first");
    return;
  }
  if (campaign.phase() == proto::CAMPAIGN_PHASE_FINISHED && !is_retry) refuse("is finished");
  if (action == proto::CONTROL_ACTION_RESUME && campaign.has_failures_max()) {
    refuse(
        fmt::format("was cancelled as more than {} runs have no estimate; submit its file again "
                    "with a larger --failures",
                    campaign.failures_max()));
  }
  if (campaign.phase() == proto::CAMPAIGN_PHASE_CANCELLED && needs_resume)
    refuse("is cancelled; resume it first");
  if (is_retry && campaign.num_given_up() == 0) refuse("has no run that was given up");
}

wire::Fields fields_of(const proto::ControlRequest& request) {
  wire::Fields fields{{"request", wire::name_of(request.action())}};
  if (request.action() == proto::CONTROL_ACTION_SET_PRIORITY) {
    fields.emplace_back("priority", std::to_string(request.priority()));
  }
  return fields;
}

StopPlan plan_of(const Request& request) {
  const proto::SubmitRequest& sent = request.message.submit();
  StopPlan plan{.stop_rule = sent.stop_rule(), .num_runs_max = {}, .failures_max = {}};
  if (sent.has_failures_max()) plan.failures_max = sent.failures_max();
  if (!plan.stop_rule.empty()) plan.num_runs_max = request.campaign->num_runs;
  return plan;
}

void write(Store& store, const Entry& entry) { (void)store.write({&entry, 1}); }

/// Makes a campaign active, with the priority and audit fraction of the request if it has them.
void write_wishes(Store& store, const Request& request) {
  const proto::SubmitRequest& sent = request.message.submit();
  CampaignControl control = store.control();
  control.phase = Phase::active;
  if (sent.has_priority()) control.priority = sent.priority();
  if (sent.has_audit_fraction()) control.audit_fraction = sent.audit_fraction();
  write(store, control);
}

/// What cannot be read at all is left to the command that answers, which says why.
/// @throws Error if another campaign's file has taken the place of this one's.
void require_own_file(const CampaignRecord& campaign) {
  try {
    if (peek_campaign(campaign.file).id == campaign.id) return;
  } catch (const StoreError&) {
    return;
  }
  throw Error(
      fmt::format("campaign database = {} (took the place of the file that is being served, and is "
                  "of another campaign; move it away)",
                  campaign.file.string()));
}

[[noreturn]] void refuse_as_under_way(const std::string& campaign) {
  throw Error(
      fmt::format("campaign = {} (another request for it is under way; try again)", campaign));
}

[[noreturn]] void refuse_as_too_many() {
  throw Error(fmt::format("{} requests are under way, which is the limit; try again later",
                          Background::num_pending_max));
}

}  // namespace

RequestService::RequestService(const ServiceContext& context, CampaignService& campaigns)
    : context_(context), campaigns_(campaigns), answers_(context) {}

bool RequestService::is_archived(const std::string& campaign) const {
  const CampaignDirectory* const directory = context_.config.directory;
  return directory != nullptr && directory->has_archived(campaign);
}

void RequestService::refuse_as_not_served(const std::string& campaign) const {
  throw Error(
      fmt::format("campaign = {} (is not served{})", campaign,
                  is_archived(campaign) ? fmt::format(": it is archived/{}.db", campaign) : ""));
}

void RequestService::control(const proto::ControlRequest& request, const Asker& asker,
                             const Respond& respond) {
  const std::string& name = request.campaign();
  const auto action = request.action();
  const auto campaign = campaigns_.find(name);
  if (!campaign) {
    require_right(asker, Right::submit);
    refuse_as_not_served(name);
  }
  require_control(asker, name, campaign->status.owner());
  require_possible(campaign->status, action);
  if (action == proto::CONTROL_ACTION_ARCHIVE) {
    if (under_way_.contains(name)) refuse_as_under_way(name);
    if (campaigns_.awaits_summary(campaign->id)) {
      return defer([this, request, asker, respond] { control(request, asker, respond); }, respond);
    }
    return campaigns_.archive(campaign->id, respond);
  }
  if (campaign->is_closed) {
    // One that has not ended is closed as its model is not here, which opening it says.
    const bool begins = action == proto::CONTROL_ACTION_RESUME ||
                        action == proto::CONTROL_ACTION_RETRY ||
                        !has_ended(wire::phase_of(campaign->status));
    return begins ? reopen(*campaign, action, respond)
                  : respond(campaigns_.done_reply(campaign->id));
  }
  if (campaigns_.is_held(campaign->id)) {
    return defer([this, request, asker, respond] { control(request, asker, respond); }, respond);
  }
  check_limits(name, *campaign, action);
  control_served(campaign->id, action, request.priority(), respond);
}

// Stored before it is done and acknowledged: what cannot be stored changes nothing.
void RequestService::control_served(CampaignId id, proto::ControlAction action, int priority,
                                    const Respond& respond) {
  const CampaignControl control = campaigns_.control_after(id, action, priority);
  const bool is_begun = campaigns_.change_held(
      id,
      [this, id, action, control] {
        std::vector<Entry> entries;
        if (action == proto::CONTROL_ACTION_RETRY) entries.emplace_back(RetriedRuns{});
        entries.emplace_back(control);
        context_.writer.access(id, [&](Store& store) { (void)store.write(entries); });
      },
      [this, id, action, control] { campaigns_.control(id, action, control); }, respond);
  if (!is_begun) refuse_as_too_many();
}

void RequestService::defer(std::function<void()> ask_again, const Respond& respond) {
  if (deferred_.size() == Background::num_pending_max) refuse_as_too_many();
  deferred_.push_back({.ask_again = std::move(ask_again), .respond = respond});
}

void RequestService::ask(const proto::AnswerRequest& request, const Asker& asker,
                         const Respond& respond) {
  const auto campaign = campaigns_.find(request.campaign());
  if (!campaign) refuse_as_not_served(request.campaign());
  // Neither brings statistics up to date, and a copy would lack them for ever.
  const bool shows_what_is_stored =
      request.question() == proto::QUESTION_DATABASE || request.question() == proto::QUESTION_QUERY;
  if (shows_what_is_stored && campaigns_.awaits_summary(campaign->id)) {
    return defer([this, request, asker, respond] { ask(request, asker, respond); }, respond);
  }
  require_own_file(*campaign);
  answers_.ask(request, campaign->file, asker, respond);
}

proto::ReplyEnvelope RequestService::take(const proto::FactoryReport& report, const Asker& asker) {
  factories_.take(report, asker.name, context_.now());
  return wire::done_reply(fmt::format("factory {}: noted", report.name()));
}

Respond RequestService::noted(const std::string& campaign, wire::Fields fields, const Asker& asker,
                              Respond respond) {
  if (!asker.name.empty()) fields.emplace_back("by", asker.name);
  return [this, campaign, event = Event::info("campaign_changed", std::move(fields)),
          respond = std::move(respond)](const proto::ReplyEnvelope& reply) {
    if (reply.has_done()) log(event, campaign);
    respond(reply);
  };
}

void RequestService::log(Event event, const std::string& campaign) const {
  const std::optional<CampaignRecord> found = campaigns_.find(campaign);
  if (found && campaigns_.is_served(found->id)) return context_.outbox.log(event, found->id);
  event.fields.emplace_back("campaign", campaign);
  context_.log(event);
}

void RequestService::carry_out(Request request, const Asker& asker, Respond respond) {
  const proto::RequestEnvelope& message = request.message;
  const auto may_observe = [&] { require_right(asker, Right::observe); };
  switch (message.request_case()) {
    case proto::RequestEnvelope::kSubmit:
      respond = noted(request.campaign->name,
                      {{"request", "submit"}, {"runs", request.campaign->num_runs}}, asker,
                      std::move(respond));
      return submit(std::make_shared<const Request>(std::move(request)), asker, std::move(respond));
    case proto::RequestEnvelope::kStatus:
      may_observe();
      return respond(status(message.status()));
    case proto::RequestEnvelope::kWorkers:
      may_observe();
      return respond(workers(message.workers()));
    case proto::RequestEnvelope::kControl:
      return control(message.control(), asker,
                     noted(message.control().campaign(), fields_of(message.control()), asker,
                           std::move(respond)));
    case proto::RequestEnvelope::kPart:
      throw Error("request = a part (must be a request when its parts are together)");
    case proto::RequestEnvelope::kReleaseHost:
      require_right(asker, Right::control);
      return respond(release_host(message.release_host().host()));
    case proto::RequestEnvelope::kAnswer:
      may_observe();
      return ask(message.answer(), asker, respond);
    case proto::RequestEnvelope::kAnswerPart:
      may_observe();
      return respond(answers_.part(message.answer_part(), asker));
    case proto::RequestEnvelope::kFactoryReport:
      may_observe();
      return respond(take(message.factory_report(), asker));
    case proto::RequestEnvelope::REQUEST_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

// Submissions.

void RequestService::submit(const Submitted& request, const Asker& asker, Respond respond) {
  const std::string& name = request->campaign->name;
  if (context_.config.files == nullptr) {
    throw Error(
        fmt::format("campaign {} cannot be submitted: this coordinator serves only the campaigns "
                    "that it began with; "
                    "start one with --directory",
                    name));
  }
  const std::optional<CampaignRecord> entry = campaigns_.find(name);
  if (entry) {
    require_control(asker, name, entry->status.owner());
  } else {
    require_right(asker, Right::submit);
    if (is_archived(name)) {
      throw Error(fmt::format(
          "campaign = {} (is archived/{}.db: move it back for more runs, or choose another name)",
          name, name));
    }
  }
  if (is_busy(name)) {
    return defer([this, request, asker, respond] { submit(request, asker, respond); }, respond);
  }
  UnderWay under_way{.owner = entry ? entry->status.owner() : asker.name,
                     .added = added_by(*request, entry)};
  check_limits(name, under_way.owner, under_way.added);
  if (entry && !entry->is_closed) {
    change_served(entry->id, request, std::move(under_way), std::move(respond));
  } else {
    open_file(request, asker, entry, std::move(under_way), std::move(respond));
  }
}

bool RequestService::is_busy(const std::string& name) const {
  if (under_way_.contains(name)) return true;
  const std::optional<CampaignRecord> entry = campaigns_.find(name);
  return entry && !entry->is_closed && campaigns_.is_held(entry->id);
}

void RequestService::review() {
  answers_.review();
  for (const Deferred& waiting : std::exchange(deferred_, {})) {
    respond_or_say_why(waiting.respond, waiting.ask_again);
  }
}

// More runs of an unfinished campaign may make its tables larger. One that has ended begins again
// if it was cancelled, gets more runs, or has a stop rule that was not checked yet.
RequestService::Holdings RequestService::added_by(
    const Request& request, const std::optional<CampaignRecord>& entry) const {
  const Holdings wanted{.num_campaigns = 1, .size = definition_size(*request.campaign)};
  if (!entry || entry->is_closed) return wanted;
  const CampaignId id = entry->id;
  const Holdings held = campaigns_.holdings_of(id);
  if (held.num_campaigns > 0) {
    return {.num_campaigns = 0, .size = wanted.size - std::min(held.size, wanted.size)};
  }
  const StopPlan plan = plan_of(request);
  const std::uint64_t num_runs_now = campaigns_.num_runs_of(id);
  const bool has_more = horizon_of(plan, request.campaign->num_runs, num_runs_now) > num_runs_now;
  const bool has_new_rule = !plan.stop_rule.empty() && plan != campaigns_.plan_of(id);
  const bool is_cancelled = entry->status.phase() == proto::CAMPAIGN_PHASE_CANCELLED;
  return has_more || has_new_rule || is_cancelled ? wanted : Holdings{};
}

void RequestService::check_limits(const std::string& campaign, const CampaignRecord& entry,
                                  proto::ControlAction action) const {
  const bool begins =
      action == proto::CONTROL_ACTION_RESUME || action == proto::CONTROL_ACTION_RETRY;
  if (!begins || campaigns_.holdings_of(entry.id).num_campaigns > 0) return;
  const Campaign& definition = *context_.state.campaigns.at(entry.id).definition;
  check_limits(campaign, entry.status.owner(),
               {.num_campaigns = 1, .size = definition_size(definition)});
}

// Files without an owner, and all files of a coordinator without keys, are not limited: a client
// that can reach it can fill its disk in other ways.
void RequestService::check_limits(const std::string& campaign, const std::string& owner,
                                  const Holdings& added) const {
  if (owner.empty()) return;
  Holdings holdings = campaigns_.holdings_of(owner);
  for (const auto& [name, under_way] : under_way_) {
    if (under_way.owner != owner || name == campaign) continue;
    holdings.num_campaigns += under_way.added.num_campaigns;
    holdings.size += under_way.added.size;
  }
  holdings.num_campaigns += added.num_campaigns;
  holdings.size += added.size;
  const auto& [campaigns_max, size_max] = context_.config.limits;
  if (added.num_campaigns > 0 && holdings.num_campaigns > campaigns_max) {
    throw Error(fmt::format(
        "campaigns = {} (must be at most {} unfinished ones of the key {}; cancel one, or wait)",
        holdings.num_campaigns, campaigns_max, owner));
  }
  if (added.size > 0 && holdings.size > size_max) {
    throw Error(fmt::format(
        "definitions size = {} bytes (must be at most {} of the unfinished campaigns of the key "
        "{}; cancel one, or wait)",
        holdings.size, size_max, owner));
  }
}

void RequestService::open_file(const Submitted& request, const Asker& asker,
                               const std::optional<CampaignRecord>& closed, UnderWay under_way,
                               Respond respond) {
  CampaignFiles& files = *context_.config.files;
  std::optional<std::filesystem::path> known;
  if (closed) known = closed->file;
  serve_opened(
      request->campaign->name, std::move(under_way),
      [&files, request, asker, known] {
        return files.open(*request->campaign, plan_of(*request), asker, known);
      },
      [request](Store& store) { write_wishes(store, *request); }, std::move(respond));
}

void RequestService::reopen(const CampaignRecord& campaign, proto::ControlAction action,
                            const Respond& respond) {
  const std::string& name = campaign.status.name();
  const std::string& owner = campaign.status.owner();
  if (under_way_.contains(name)) refuse_as_under_way(name);
  check_limits(name, owner, {.num_campaigns = 1, .size = 0});
  // What its definition takes is known when the file is read, which must not change if that is too
  // much: so it is opened twice.
  const auto load = [&directory = *context_.config.directory, file = campaign.file] {
    return directory.load(file);
  };
  const auto measure = [load] { return definition_size(*load().definition); };
  const auto go_on = [this, name, owner, action, load, respond](std::future<std::uint64_t> size) {
    under_way_.erase(name);
    respond_or_say_why(respond, [&] {
      UnderWay under_way{.owner = owner, .added = {.num_campaigns = 1, .size = size.get()}};
      check_limits(name, owner, under_way.added);
      serve_opened(
          name, std::move(under_way), load,
          [action](Store& store) {
            if (action == proto::CONTROL_ACTION_RETRY) write(store, RetriedRuns{});
            CampaignControl control = store.control();
            control.phase = Phase::active;
            write(store, control);
          },
          respond);
    });
  };
  if (!context_.background.post(work_of(measure, go_on))) refuse_as_too_many();
  under_way_.emplace(name, UnderWay{.owner = owner, .added = {.num_campaigns = 1}});
}

void RequestService::serve_opened(const std::string& name, UnderWay under_way,
                                  std::function<ServedCampaign()> open,
                                  std::function<void(Store&)> activate, Respond respond) {
  const auto made = std::make_shared<std::filesystem::path>();
  const auto work = [this, name, made, open = std::move(open), activate = std::move(activate)] {
    try {
      require_room_for_campaign("campaign = " + name, context_.config.num_descriptors_reserved);
      ServedCampaign campaign = open();
      if (campaign.is_new) *made = campaign.file;
      activate(campaign.store);
      return prepare(std::move(campaign), GivenUpRuns::keep, context_.start);
    } catch (const std::exception&) {
      if (!made->empty()) remove_made(*made);
      throw;
    }
  };
  const auto then = [this, name, made, respond](std::future<FileLook> look) {
    under_way_.erase(name);
    respond_or_say_why(respond, [&] { respond(serve(look.get(), *made)); });
  };
  if (!context_.background.post(work_of(work, then))) refuse_as_too_many();
  under_way_.emplace(name, std::move(under_way));
}

// A campaign of that name may have come into the directory while the file was made.
proto::ReplyEnvelope RequestService::serve(FileLook look, const std::filesystem::path& made) {
  const CampaignId id = look.record.id;
  try {
    campaigns_.add(std::move(look));
  } catch (const std::exception&) {
    if (!made.empty() && !campaigns_.is_served(id)) remove_made(made);
    throw;
  }
  campaigns_.review();
  return campaigns_.done_reply(id);
}

void RequestService::change_served(CampaignId id, const Submitted& request, UnderWay under_way,
                                   Respond respond) {
  const StopPlan plan = plan_of(*request);
  const std::uint64_t num_runs =
      horizon_of(plan, request->campaign->num_runs, campaigns_.num_runs_of(id));
  const bool has_new_plan = plan != campaigns_.plan_of(id);
  const auto extended = std::make_shared<std::shared_ptr<const Campaign>>();
  const bool is_begun = campaigns_.change_held(
      id,
      [this, id, request, plan, num_runs, has_new_plan, extended,
       file = campaigns_.record_of(id).file] {
        const std::unique_ptr<Campaign> wanted = request->campaign->clone();
        wanted->num_runs = num_runs;
        context_.config.files->require_same(file, *wanted);
        context_.writer.access(id, [&](Store& store) {
          *extended = context_.config.files->extend(store, *wanted);
          if (has_new_plan) store.set_stop_plan(plan);
          if (store.control().phase != Phase::finished) write_wishes(store, *request);
        });
      },
      [this, id, request, plan, extended] {
        campaigns_.change(id, *extended, plan, request->message.submit());
      },
      [this, request, respond = std::move(respond)](proto::ReplyEnvelope reply) {
        under_way_.erase(request->campaign->name);
        respond(std::move(reply));
      });
  if (!is_begun) refuse_as_too_many();
  under_way_.emplace(request->campaign->name, std::move(under_way));
}

}  // namespace proofmass::coordinator
