#include "coordinator/net/peers.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "proto/proofmass.pb.h"

namespace proofmass::coordinator {

using wire::WorkerId;

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

}  // namespace proofmass::coordinator
