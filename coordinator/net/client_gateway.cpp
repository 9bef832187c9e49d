#include "coordinator/net/client_gateway.hpp"

#include <fmt/format.h>

#include <exception>
#include <functional>
#include <iterator>
#include <utility>
#include <variant>

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/result_rules.hpp"
#include "proto/model_program/described_model.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::chrono::seconds told_every(1);
constexpr std::chrono::seconds silence_max(30);  // Between two parts of a request.

proto::ReplyEnvelope part_reply(std::uint64_t next_offset) {
  proto::ReplyEnvelope reply;
  reply.mutable_part()->set_next_offset(next_offset);
  return reply;
}

/// The one that the client has; this program need not have it.
const Model& model_of(const proto::SubmitRequest& submit) {
  const std::string& version = submit.definition().model_version();
  if (version.empty()) return built_in_model();
  return wire::recorded_model({.version = version,
                               .description = submit.model_description(),
                               .reference_digest = submit.reference_digest()});
}

/// @throws Error with what is wrong; others, as memory may be short for what a request becomes.
Request request_in(std::string_view bytes) {
  auto decoded = wire::decode_request(bytes);
  if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) throw Error(error->text);
  return request_of(std::move(std::get<proto::RequestEnvelope>(decoded)));
}

}  // namespace

Request request_of(proto::RequestEnvelope message) {
  if (!message.has_submit()) return {.message = std::move(message)};
  const Model& model = model_of(message.submit());
  std::shared_ptr<const Campaign> campaign = model.campaign_of(
      wire::take_definition(*message.mutable_submit()), TableColumns::included, "definition");
  check_campaign_name(campaign->name, NameOrigin::given);
  const std::string& rule = message.submit().stop_rule();
  if (!rule.empty()) (void)parse_stop_rule(rule, campaign->results());
  return {.message = std::move(message), .campaign = std::move(campaign)};
}

RequestParts::Outcome RequestParts::take(const std::string& connection, std::uint64_t request,
                                         const proto::RequestPart& part, TimePoint now) {
  auto found = unfinished_.find(connection);
  const bool is_known = found != unfinished_.end() && found->second.request == request &&
                        found->second.total_size == part.total_size();
  if (!is_known) {
    if (part.offset() != 0) return part_reply(0);
    if (found != unfinished_.end()) drop(found);
    if (part.total_size() > size_max_ - size_held_) {
      return wire::error_reply(
          fmt::format("request size = {} bytes (the coordinator is receiving {} bytes of others, "
                      "at most {} together: try again later)",
                      part.total_size(), size_held_, size_max_));
    }
    Unfinished begun{
        .request = request, .total_size = part.total_size(), .bytes = {}, .heard_at = now};
    begun.bytes.reserve(begun.total_size);
    size_held_ += begun.total_size;
    found = unfinished_.emplace(connection, std::move(begun)).first;
  }
  Unfinished& unfinished = found->second;
  unfinished.heard_at = now;
  if (part.offset() == unfinished.bytes.size()) unfinished.bytes += part.slice();
  if (unfinished.bytes.size() < unfinished.total_size) {
    return part_reply(unfinished.bytes.size());
  }
  std::string bytes = std::move(unfinished.bytes);
  unfinished_.erase(found);
  return bytes;
}

void RequestParts::release(std::size_t size) {
  PROOFMASS_EXPECT(size <= size_held_);
  size_held_ -= size;
}

void RequestParts::drop_stale(TimePoint now) {
  for (auto connection = unfinished_.begin(); connection != unfinished_.end();) {
    const bool is_stale = now - connection->second.heard_at > silence_max;
    connection = is_stale ? drop(connection) : std::next(connection);
  }
}

RequestParts::Connections::iterator RequestParts::drop(Connections::iterator connection) {
  size_held_ -= connection->second.total_size;
  return unfinished_.erase(connection);
}

ClientGateway::ClientGateway(Background& background, Callbacks callbacks)
    : background_(background), callbacks_(std::move(callbacks)) {}

void ClientGateway::receive(const Incoming& message) {
  try {
    take(message);
  } catch (const std::exception& error) {
    send({.routing_id = message.from.routing_id, .request = 0}, wire::error_reply(error.what()));
  }
}

Asker ClientGateway::asker_of(const std::string& key) const {
  if (std::optional<Asker> asker = callbacks_.asker_of(key)) return *std::move(asker);
  throw Error(fmt::format("key = {} (is not authorized any more)", key));
}

void ClientGateway::take(const Incoming& message) {
  (void)asker_of(message.from.key);
  if (message.frames.size() != 1) {
    throw Error(fmt::format("request = {} frames (must be one)", message.frames.size()));
  }
  const std::string_view bytes = message.frames.front();
  if (bytes.size() > wire::request_message_size_max) {
    throw Error(fmt::format(
        "request size = {} bytes (must be at most {} in one message; larger ones travel in parts)",
        bytes.size(), wire::request_message_size_max));
  }
  Request request = request_in(bytes);
  const std::uint64_t id = request.message.request_id();
  if (request.message.has_part()) return take_part(message.from, id, request.message.part());
  const auto ticket = begin(message.from, id, bytes);
  if (ticket) carry_out(*ticket, message.from.key, [&] { return std::move(request); });
}

void ClientGateway::take_part(const Address& from, std::uint64_t request,
                              const proto::RequestPart& part) {
  RequestParts::Outcome outcome = parts_.take(from.routing_id, request, part, callbacks_.now());
  const Waiter waiter{.routing_id = from.routing_id, .request = request};
  if (auto* const reply = std::get_if<proto::ReplyEnvelope>(&outcome)) {
    return send(waiter, std::move(*reply));
  }
  send(waiter, part_reply(part.total_size()));
  take_whole(from, request, std::get<std::string>(std::move(outcome)));
}

void ClientGateway::take_whole(const Address& from, std::uint64_t request, std::string bytes) {
  const std::size_t size = bytes.size();
  const auto begun = begin(from, request, bytes);
  if (!begun) return parts_.release(size);
  const std::uint64_t ticket = *begun;
  const bool is_posted = background_.post(work_of(
      // The bytes are freed once they have been read.
      [bytes = std::move(bytes)]() mutable { return request_in(std::exchange(bytes, {})); },
      [this, ticket, size, key = from.key](std::future<Request> read) {
        parts_.release(size);
        carry_out(ticket, key, [&] { return read.get(); });
      }));
  if (is_posted) return;
  parts_.release(size);
  respond(ticket, wire::error_reply(
                      fmt::format("{} requests are under way, which is the limit; try again later",
                                  Background::num_pending_max)));
}

void ClientGateway::carry_out(std::uint64_t ticket, const std::string& key,
                              const std::function<Request()>& take_request) {
  const Respond to_all = [this, ticket](const proto::ReplyEnvelope& reply) {
    respond(ticket, reply);
  };
  respond_or_say_why(to_all, [&] { callbacks_.carry_out(take_request(), asker_of(key), to_all); });
}

std::optional<std::uint64_t> ClientGateway::begin(const Address& from, std::uint64_t request,
                                                  std::string_view bytes) {
  const std::size_t hash = std::hash<std::string_view>()(bytes);
  const Waiter waiter{.routing_id = from.routing_id, .request = request};
  for (auto& [ticket, pending] : pending_) {
    if (pending.hash != hash || pending.size != bytes.size() || pending.key != from.key) continue;
    if (pending.waiters.size() < waiters_max) {
      pending.waiters.push_back(waiter);
    } else {
      send(waiter, wire::error_reply(fmt::format(
                       "{} clients wait for the answer to this request already; try again "
                       "later",
                       waiters_max)));
    }
    return std::nullopt;
  }
  const std::uint64_t ticket = next_ticket_++;
  pending_.emplace(ticket, Pending{.key = from.key,
                                   .size = bytes.size(),
                                   .hash = hash,
                                   .waiters = {waiter},
                                   .told_at = callbacks_.now()});
  return ticket;
}

void ClientGateway::respond(std::uint64_t ticket, const proto::ReplyEnvelope& reply) {
  const auto found = pending_.find(ticket);
  if (found == pending_.end()) return;
  const std::vector<Waiter> waiters = std::move(found->second.waiters);
  pending_.erase(found);
  for (const Waiter& waiter : waiters) send(waiter, reply);
}

void ClientGateway::send(const Waiter& waiter, proto::ReplyEnvelope reply) {
  callbacks_.paths.hide_in(reply);
  reply.set_request_id(waiter.request);
  std::string bytes;
  try {
    bytes = wire::encode(std::move(reply));
  } catch (const Error& error) {
    proto::ReplyEnvelope refused = wire::error_reply(error.what());
    refused.set_request_id(waiter.request);
    bytes = wire::encode(std::move(refused));
  }
  callbacks_.transmit(waiter.routing_id, bytes);
}

void ClientGateway::review() {
  const TimePoint now = callbacks_.now();
  proto::ReplyEnvelope wait;
  wait.mutable_wait();
  parts_.drop_stale(now);
  for (auto& [ticket, pending] : pending_) {
    if (now - pending.told_at < told_every) continue;
    pending.told_at = now;
    for (const Waiter& waiter : pending.waiters) send(waiter, wait);
  }
}

}  // namespace proofmass::coordinator
