// What clients are told of the coordinator and of its workers.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <ranges>
#include <set>
#include <string>
#include <utility>

#include "coordinator/dispatch/events.hpp"
#include "coordinator/net/request_service.hpp"
#include "coordinator/net/service_snapshot.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

/// Workers with several keys may run there.
std::set<std::string> quarantined_hosts(const State& state) {
  std::set<std::string> names;
  for (const auto& [host, until] : state.quarantined) names.insert(state.hosts.at(host).name);
  return names;
}

}  // namespace

proto::StatusReply RequestService::service_status() const {
  const State& state = context_.state;
  const TimePoint now = context_.now();
  proto::StatusReply reply;
  reply.set_version(context_.config.version);
  reply.set_model_version(std::string(built_in_model().version()));
  reply.set_uptime_s(seconds(std::chrono::steady_clock::now() - began_at_));
  reply.set_num_workers(state.workers.size());
  reply.set_num_slots(state.num_slots);
  reply.set_num_campaigns(campaigns_.num_campaigns());
  campaigns_.add_unserved(reply);
  const std::set<std::string> hosts = quarantined_hosts(state);
  reply.set_num_quarantined_hosts(hosts.size());
  for (const std::string& host : hosts | std::views::take(wire::quarantined_hosts_per_reply_max)) {
    reply.add_quarantined_hosts(host);
  }
  for (proto::FactoryStatus& factory : factories_.current(now)) {
    *reply.add_factories() = std::move(factory);
  }
  reply.set_num_refusals(state.num_refusals);
  reply.set_last_refusal(state.last_refusal);
  if (state.num_refusals > 0) reply.set_last_refusal_s(seconds(now - state.refused_at));
  return reply;
}

proto::ReplyEnvelope RequestService::status(const proto::StatusRequest& request) const {
  proto::ReplyEnvelope reply;
  proto::StatusReply& status = *reply.mutable_status();
  status = service_status();
  for (CampaignRecord& campaign :
       campaigns_.records(request.first_campaign(), wire::campaigns_per_reply_max)) {
    *status.add_campaigns() = std::move(campaign.status);
  }
  return reply;
}

proto::ReplyEnvelope RequestService::workers(const proto::WorkersRequest& request) const {
  const State& state = context_.state;
  const TimePoint now = context_.now();
  proto::ReplyEnvelope reply;
  proto::WorkersReply& workers = *reply.mutable_workers();
  workers.set_num_workers(state.workers.size());
  for (auto item = state.workers.upper_bound(WorkerId{request.after_worker_id()});
       item != state.workers.end() &&
       static_cast<std::size_t>(workers.workers_size()) < wire::workers_per_reply_max;
       ++item) {
    const auto& [id, worker] = *item;
    *workers.add_workers() = record_of(state, id, worker, now).status;
  }
  return reply;
}

proto::ReplyEnvelope RequestService::release_host(const std::string& host) {
  if (!on_release_host(context_.state, host, context_.now(), context_.outbox)) {
    const std::set<std::string> others = quarantined_hosts(context_.state);
    throw Error(fmt::format(
        "host = {} (is not in quarantine; {})", host,
        others.empty() ? "no host is" : fmt::format("there is {}", fmt::join(others, ", "))));
  }
  return wire::done_reply(fmt::format("host {}: runs are lent to its workers again", host));
}

}  // namespace proofmass::coordinator
