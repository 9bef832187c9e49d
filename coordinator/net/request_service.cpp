#include "coordinator/net/request_service.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "coordinator/dispatch/workers.hpp"
#include "core/campaign/model.hpp"
#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

/// Workers with several keys may run there.
std::set<std::string> quarantined_hosts(const State& state) {
  std::set<std::string> names;
  for (const HostId& host : state.quarantined) names.insert(host.name);
  return names;
}

/// @throws Error if the action can have no effect. A finished campaign can only be retried, and
/// only if runs were given up; a cancelled one must be resumed before it is retried or gets a
/// priority.
void require_possible(const wire::CampaignStatus& campaign, wire::ControlAction action) {
  const auto refuse = [&](std::string_view why) {
    throw Error(fmt::format("campaign = {} ({})", campaign.name, why));
  };
  const bool is_retry = action == wire::ControlAction::retry;
  const bool needs_resume = is_retry || action == wire::ControlAction::set_priority;
  if (campaign.phase == Phase::finished && !is_retry) refuse("is finished");
  if (campaign.phase == Phase::cancelled && needs_resume) refuse("is cancelled; resume it first");
  if (is_retry && campaign.num_given_up == 0) refuse("has no run that was given up");
}

}  // namespace

RequestService::RequestService(Surroundings surroundings)
    : surroundings_(std::move(surroundings)), began_at_(surroundings_.now()) {}

template <>
void RequestService::take(Submission&& submission, const Asker& asker, const Respond& respond) {
  surroundings_.submissions.submit(std::make_shared<const Submission>(std::move(submission)), asker,
                                   respond);
}

template <>
void RequestService::take(wire::ControlRequest&& request, const Asker& asker,
                          const Respond& respond) {
  CampaignService& campaigns = surroundings_.campaigns;
  const auto campaign = campaigns.find(request.campaign);
  if (!campaign) {
    require_right(asker, Right::submit);
    throw Error(fmt::format("campaign = {} (is not served)", request.campaign));
  }
  require_control(asker, request.campaign, campaign->owner);
  require_possible(campaigns.status_of(campaign->id), request.action);
  if (campaign->has_ended) return control_ended(*campaign, request.action, respond);
  respond(campaigns.control(campaign->id, request));
}

void RequestService::control_ended(const CampaignService::Entry& campaign,
                                   wire::ControlAction action, const Respond& respond) {
  if (action == wire::ControlAction::resume || action == wire::ControlAction::retry) {
    return surroundings_.submissions.reopen(campaign, action, respond);
  }
  respond(surroundings_.campaigns.done_reply(campaign.id));
}

template <>
void RequestService::take(wire::StatusRequest&& request, const Asker& asker,
                          const Respond& respond) {
  require_right(asker, Right::observe);
  const State& state = surroundings_.state;
  const CampaignService& campaigns = surroundings_.campaigns;
  const DirectoryService& directory = surroundings_.directory;
  const Duration uptime = surroundings_.now() - began_at_;
  wire::StatusReply reply{
      .version = surroundings_.version,
      .model_version = std::string(model().version()),
      .uptime_s = std::chrono::duration<double>(uptime).count(),
      .num_workers = state.workers.size(),
      .num_slots = state.num_slots,
      .campaigns = campaigns.statuses(request.first_campaign, wire::campaigns_per_reply_max),
      .num_campaigns = campaigns.num_campaigns(),
      .unserved_files = directory.unserved(wire::unserved_files_per_reply_max),
      .num_unserved_files = directory.num_unserved()};
  const std::set<std::string> hosts = quarantined_hosts(state);
  reply.num_quarantined_hosts = hosts.size();
  for (const std::string& host : hosts) {
    if (reply.quarantined_hosts.size() == wire::quarantined_hosts_per_reply_max) break;
    reply.quarantined_hosts.push_back(host);
  }
  respond(std::move(reply));
}

template <>
void RequestService::take(wire::WorkersRequest&& request, const Asker& asker,
                          const Respond& respond) {
  require_right(asker, Right::observe);
  const State& state = surroundings_.state;
  const TimePoint now = surroundings_.now();
  wire::WorkersReply reply{.workers = {}, .num_workers = state.workers.size()};
  for (auto item = state.workers.upper_bound(WorkerId{request.after_worker_id});
       item != state.workers.end() && reply.workers.size() < wire::workers_per_reply_max; ++item) {
    const auto& [id, worker] = *item;
    reply.workers.push_back(
        {.id = id,
         .name = worker.name,
         .host = worker.host.name,
         .process_id = worker.process_id,
         .num_slots = worker.num_slots,
         .num_lent = worker.num_lent,
         .num_results = worker.num_results,
         .silent_s = std::chrono::duration<double>(now - worker.heard_at).count(),
         .is_quarantined = state.quarantined.contains(worker.host)});
  }
  respond(std::move(reply));
}

template <>
void RequestService::take(wire::ReleaseHostRequest&& request, const Asker& asker,
                          const Respond& respond) {
  require_right(asker, Right::control);
  if (!on_release_host(surroundings_.state, request.host, surroundings_.now(),
                       surroundings_.outbox)) {
    throw Error(fmt::format("host = {} (is not in quarantine)", request.host));
  }
  respond(
      wire::DoneReply{fmt::format("host {}: runs are lent to its workers again", request.host)});
}

template <>
void RequestService::take(wire::RequestPart&&, const Asker&, const Respond&) {
  throw Error("request = a part (must be a request when its parts are together)");
}

void RequestService::carry_out(Request request, const Asker& asker, Respond respond) {
  std::visit([&](auto& content) { take(std::move(content), asker, respond); }, request);
}

}  // namespace proofmass::coordinator
