#include "coordinator/net/worker_gateway.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "coordinator/dispatch/events.hpp"
#include "core/error.hpp"
#include "proto/link/faults.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::coordinator {
namespace {

using wire::KillPoint;

std::string revoked_text(const Address& address) {
  return fmt::format("key = {} (is not authorized any more)", address.key);
}

/// A Unix domain socket's address ends with the process.
HostId host_of(const Address& from) {
  constexpr std::string_view local = "localhost";
  return {.key = from.key,
          .address = from.host.starts_with(local) ? std::string(local) : from.host};
}

}  // namespace

wire::Fields fields_of(const Address& address) {
  return {{"address", address.host.empty() ? "unknown" : address.host},
          {"key", address.key.empty() ? "none" : address.key}};
}

std::optional<WorkerId> Peers::meet(wire::SessionId session, std::uint64_t sequence,
                                    const Address& address) {
  const auto at_address = worker_at(address.routing_id);
  const auto known = by_session_.find(session.value);
  if (known == by_session_.end()) {
    if (at_address) return std::nullopt;
    const WorkerId worker{next_++};
    by_session_[session.value] = worker;
    by_routing_id_[address.routing_id] = worker;
    peers_[worker] = {.session = session, .address = address, .newest_sequence = sequence};
    return worker;
  }
  const WorkerId worker = known->second;
  Peer& peer = peers_.at(worker);
  if (peer.address.key != address.key || (at_address && *at_address != worker)) return std::nullopt;
  if (!at_address && sequence > peer.newest_sequence) {
    by_routing_id_.erase(peer.address.routing_id);
    by_routing_id_[address.routing_id] = worker;
    peer.address = address;
  }
  peer.newest_sequence = std::max(peer.newest_sequence, sequence);
  return worker;
}

std::optional<WorkerId> Peers::worker_at(const std::string& routing_id) const {
  const auto found = by_routing_id_.find(routing_id);
  if (found == by_routing_id_.end()) return std::nullopt;
  return found->second;
}

const Address* Peers::address_of(WorkerId worker) const {
  const auto found = peers_.find(worker);
  return found == peers_.end() ? nullptr : &found->second.address;
}

std::optional<WorkerId> Peers::worker_of(wire::SessionId session) const {
  const auto found = by_session_.find(session.value);
  if (found == by_session_.end()) return std::nullopt;
  return found->second;
}

std::vector<WorkerId> Peers::workers() const {
  std::vector<WorkerId> workers;
  for (const auto& [worker, peer] : peers_) workers.push_back(worker);
  return workers;
}

void Peers::address(WorkerId worker, proto::Envelope& message) {
  const auto found = peers_.find(worker);
  PROOFMASS_EXPECT(found != peers_.end());
  message.set_session(found->second.session.value);
  message.set_sequence(++found->second.num_sent);
}

void Peers::forget(WorkerId worker) {
  const auto found = peers_.find(worker);
  if (found == peers_.end()) return;
  by_session_.erase(found->second.session.value);
  by_routing_id_.erase(found->second.address.routing_id);
  peers_.erase(found);
}

void Peers::close_out(const std::string& routing_id) {
  if (closed_out_.size() >= limits_.closed_out_max) closed_out_.clear();
  closed_out_.insert(routing_id);
}

bool Peers::is_closed_out(const std::string& routing_id) const {
  return closed_out_.contains(routing_id);
}

void Peers::limit(const std::function<bool(WorkerId)>& is_registered) {
  if (peers_.size() < limits_.peers_max) return;
  for (const WorkerId worker : workers()) {
    if (!is_registered(worker)) forget(worker);
  }
}

proto::DefinitionPart DefinitionCache::part(wire::CampaignId campaign, std::uint64_t offset,
                                            const std::shared_ptr<const Campaign>& definition) {
  auto found = entries_.find(campaign);
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
    found = entries_.emplace(campaign, std::move(entry)).first;
  }
  found->second.used = ++num_uses_;
  return found->second.encoded.part(campaign, offset);
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
    return close_out(message.from, proto::REJECT_REASON_REVOKED, revoked_text(message.from), now,
                     outbox);
  }
  google::protobuf::Arena arena;
  const proto::Envelope* const envelope = decode(message, arena, now, outbox);
  if (envelope == nullptr) return;
  const auto worker = peers_.meet({envelope->session()}, envelope->sequence(), message.from);
  if (!worker) {
    return close_out(
        message.from, proto::REJECT_REASON_MALFORMED,
        fmt::format("session = {} (must be one connection's and one key's)", envelope->session()),
        now, outbox);
  }
  if (envelope->epoch() != epoch_.value && !envelope->has_hello()) {
    return reject_unregistered(*worker, outbox);
  }
  if (envelope->has_result_batch()) wire::kill_point(KillPoint::after_receive);
  on_message(state_, *worker, host_of(message.from), *envelope, now, outbox);
}

const proto::Envelope* WorkerGateway::decode(const Incoming& message,
                                             google::protobuf::Arena& arena, TimePoint now,
                                             Outbox& outbox) {
  if (message.frames.size() != 1) {
    close_out(message.from, proto::REJECT_REASON_MALFORMED,
              fmt::format("message = {} frames (must be one)", message.frames.size()), now, outbox);
    return nullptr;
  }
  const auto decoded = wire::decode(message.frames.front(), arena);
  if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
    const bool is_other_version = error->fault == wire::DecodeFault::wrong_version;
    close_out(message.from,
              is_other_version ? proto::REJECT_REASON_INCOMPATIBLE : proto::REJECT_REASON_MALFORMED,
              error->text, now, outbox);
    return nullptr;
  }
  const auto* const envelope = std::get<const proto::Envelope*>(decoded);
  if (!wire::is_of_worker(*envelope)) {
    close_out(message.from, proto::REJECT_REASON_MALFORMED,
              "message = one of a coordinator (must be one of a worker)", now, outbox);
    return nullptr;
  }
  return envelope;
}

void WorkerGateway::close_out(const Address& from, proto::RejectReason reason,
                              const std::string& text, TimePoint now, Outbox& outbox) {
  wire::Fields fields = fields_of(from);
  fields.push_back(Field::reason(text));
  outbox.log(Event::warning("peer_closed_out", std::move(fields)));
  proto::Envelope reject = wire::rejection(reason, text);
  const auto worker = peers_.worker_at(from.routing_id);
  if (worker) {
    send(*worker, std::move(reject));
    on_gone(state_, *worker, LossReason::protocol, now, outbox);
    peers_.forget(*worker);
  } else {
    // The session is not known; the peer accepts any as its own.
    reject.set_session(1);
    reject.set_sequence(1);
    transmit(from, std::move(reject));
  }
  peers_.close_out(from.routing_id);
}

void WorkerGateway::send(WorkerId worker, proto::Envelope message) {
  const Address* const address = peers_.address_of(worker);
  if (address == nullptr) return;
  const bool is_lease = message.has_run_lease();
  const bool is_acknowledgement = message.has_result_ack();
  peers_.address(worker, message);
  transmit(*address, std::move(message));
  if (is_lease) wire::kill_point(KillPoint::after_lend);
  if (is_acknowledgement) wire::kill_point(KillPoint::after_acknowledge);
}

void WorkerGateway::send_definition(WorkerId worker, wire::CampaignId campaign,
                                    std::uint64_t offset,
                                    const std::shared_ptr<const Campaign>& definition) {
  proto::Envelope envelope;
  *envelope.mutable_definition_part() = definitions_.part(campaign, offset, definition);
  send(worker, std::move(envelope));
}

void WorkerGateway::transmit(const Address& to, proto::Envelope message) {
  message.set_epoch(epoch_.value);
  if (!callbacks_.transmit(to.routing_id, wire::encode(std::move(message)))) ++num_unsent_;
}

void WorkerGateway::review(TimePoint now, Outbox& outbox) {
  for (const WorkerId worker : peers_.workers()) {
    const Address address = *peers_.address_of(worker);
    if (callbacks_.is_allowed(address.key, now)) continue;
    close_out(address, proto::REJECT_REASON_REVOKED, revoked_text(address), now, outbox);
  }
  peers_.limit([&](WorkerId worker) { return state_.workers.contains(worker); });
}

}  // namespace proofmass::coordinator
