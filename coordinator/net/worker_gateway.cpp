#include "coordinator/net/worker_gateway.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "coordinator/dispatch/workers.hpp"
#include "proto/link/faults.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator {
namespace {

using wire::KillPoint;
using wire::RejectReason;

template <typename Kind>
bool is_a(const wire::Message& message) {
  return std::holds_alternative<Kind>(message);
}

std::string revoked_text(const Address& address) {
  return fmt::format("key = {} (is not authorized any more)", address.key);
}

/// A Unix domain socket's address ends with the process.
HostId host_of(const Address& from) {
  constexpr std::string_view local = "localhost";
  return {.key = from.key,
          .address = from.host.starts_with(local) ? std::string(local) : from.host};
}

bool is_of_a_worker(const wire::Message& message) {
  return wire::visit_if<wire::WorkerMessage>(message, [](const auto&) {});
}

}  // namespace

wire::DefinitionPart DefinitionCache::part(const wire::CampaignRequest& request,
                                           const std::shared_ptr<const Campaign>& definition) {
  auto found = entries_.find(request.campaign);
  if (found != entries_.end() && found->second.definition != definition) {
    size_ -= found->second.encoded.size();
    entries_.erase(found);
    found = entries_.end();
  }
  if (found == entries_.end()) {
    make_room();
    Entry entry{.definition = definition,
                .encoded = wire::EncodedDefinition(definition->definition(TableColumns::left_out))};
    size_ += entry.encoded.size();
    ++num_encoded_;
    found = entries_.emplace(request.campaign, std::move(entry)).first;
  }
  found->second.used = ++num_uses_;
  return found->second.encoded.part(request);
}

void DefinitionCache::make_room() {
  while (size_ > size_max_) {
    const auto oldest = std::min_element(
        entries_.begin(), entries_.end(),
        [](const auto& a, const auto& b) { return a.second.used < b.second.used; });
    size_ -= oldest->second.encoded.size();
    entries_.erase(oldest);
  }
}

WorkerGateway::WorkerGateway(State& state, wire::Epoch epoch, Callbacks callbacks)
    : state_(state), epoch_(epoch), callbacks_(std::move(callbacks)) {}

void WorkerGateway::receive(const Incoming& message, TimePoint now, Outbox& outbox) {
  if (peers_.is_closed_out(message.from.routing_id)) return;
  if (!callbacks_.is_allowed(message.from.key, now)) {
    return close_out(message.from, RejectReason::revoked, revoked_text(message.from), now, outbox);
  }
  std::optional<wire::Packet> packet = decode(message, now, outbox);
  if (!packet) return;
  const wire::Header& header = packet->header;
  const auto worker = peers_.meet(header.session, header.sequence, message.from);
  if (!worker) {
    return close_out(
        message.from, RejectReason::malformed,
        fmt::format("session = {} (must be one connection's and one key's)", header.session.value),
        now, outbox);
  }
  if (header.epoch != epoch_ && !is_a<wire::Hello>(packet->message)) {
    return reject_unregistered(*worker, outbox);
  }
  if (const auto* const bye = std::get_if<wire::Bye>(&packet->message)) {
    callbacks_.on_leaving(*worker, bye->reason);
  }
  if (is_a<wire::ResultBatch>(packet->message)) wire::kill_point(KillPoint::after_receive);
  on_packet(state_, *worker, host_of(message.from), *std::move(packet), now, outbox);
}

std::optional<wire::Packet> WorkerGateway::decode(const Incoming& message, TimePoint now,
                                                  Outbox& outbox) {
  if (message.frames.size() != 1) {
    close_out(message.from, RejectReason::malformed,
              fmt::format("message = {} frames (must be one)", message.frames.size()), now, outbox);
    return std::nullopt;
  }
  auto decoded = wire::decode(message.frames.front());
  if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
    const bool is_other_version = error->fault == wire::DecodeFault::wrong_version;
    close_out(message.from, is_other_version ? RejectReason::incompatible : RejectReason::malformed,
              error->text, now, outbox);
    return std::nullopt;
  }
  auto& packet = std::get<wire::Packet>(decoded);
  if (!is_of_a_worker(packet.message)) {
    close_out(message.from, RejectReason::malformed,
              "message = one of a coordinator (must be one of a worker)", now, outbox);
    return std::nullopt;
  }
  return std::move(packet);
}

void WorkerGateway::close_out(const Address& from, RejectReason reason, const std::string& text,
                              TimePoint now, Outbox& outbox) {
  wire::Fields fields = fields_of(from);
  fields.push_back(Field::reason(text));
  outbox.log(
      {.severity = Severity::warning, .kind = "peer_closed_out", .fields = std::move(fields)});
  const wire::Reject reject{.reason = reason, .text = text};
  const auto worker = peers_.worker_at(from.routing_id);
  if (worker) {
    send(*worker, reject);
    callbacks_.on_leaving(*worker, LossReason::protocol);
    on_gone(state_, *worker, LossReason::protocol, now, outbox);
    peers_.forget(*worker);
  } else {
    // The session is not known; the peer accepts any as its own.
    send_packet(from,
                {.header = {.session = {1}, .epoch = epoch_, .sequence = 1}, .message = reject});
  }
  peers_.close_out(from.routing_id);
}

void WorkerGateway::send(WorkerId worker, wire::Message message) {
  const Address* const address = peers_.address_of(worker);
  if (address == nullptr) return;
  const bool is_lease = is_a<wire::RunLease>(message);
  const bool is_acknowledgement = is_a<wire::ResultAck>(message);
  send_packet(*address,
              {.header = peers_.next_header(worker, epoch_), .message = std::move(message)});
  if (is_lease) wire::kill_point(KillPoint::after_lend);
  if (is_acknowledgement) wire::kill_point(KillPoint::after_acknowledge);
}

void WorkerGateway::send_definition(WorkerId worker, const wire::CampaignRequest& request,
                                    const std::shared_ptr<const Campaign>& definition) {
  send(worker, definitions_.part(request, definition));
}

void WorkerGateway::send_packet(const Address& to, const wire::Packet& packet) {
  if (!callbacks_.transmit(to.routing_id, wire::encode(packet))) ++num_unsent_;
}

void WorkerGateway::review(TimePoint now, Outbox& outbox) {
  for (const WorkerId worker : peers_.workers()) {
    const Address address = *peers_.address_of(worker);
    if (callbacks_.is_allowed(address.key, now)) continue;
    close_out(address, RejectReason::revoked, revoked_text(address), now, outbox);
  }
  peers_.limit([&](WorkerId worker) { return state_.workers.contains(worker); });
}

}  // namespace proofmass::coordinator
