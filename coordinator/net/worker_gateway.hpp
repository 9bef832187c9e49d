#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/router_socket.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/definition_codec.hpp"

namespace proofmass::coordinator {

/// `address=10.0.0.7 key=...`, for logs.
[[nodiscard]] wire::Fields fields_of(const Address& address);

/// Connects the session of a worker process with its number in the dispatch, and with the
/// connection on which it was heard last.
class Peers {
 public:
  /// Limits of what is kept about peers.
  struct Limits {
    std::size_t peers_max = 65536;
    std::size_t closed_out_max = 65536;
  };

  Peers() = default;
  explicit Peers(Limits limits) : limits_(limits) {}

  /// The worker of a session, which is reached at this address from now on; a new one if the
  /// session has not been seen.
  ///
  /// @param sequence  Of the message: one from a connection that was left changes no address.
  /// @return Nothing if the session belongs to another key, or the connection to another session.
  [[nodiscard]] std::optional<wire::WorkerId> meet(wire::SessionId session, std::uint64_t sequence,
                                                   const Address& address);

  /// The worker of a connection.
  [[nodiscard]] std::optional<wire::WorkerId> worker_at(const std::string& routing_id) const;

  /// Null if the peer has been forgotten.
  [[nodiscard]] const Address* address_of(wire::WorkerId worker) const;

  /// Nothing if the peer has been forgotten.
  [[nodiscard]] std::optional<wire::WorkerId> worker_of(wire::SessionId session) const;

  /// All whose addresses are known.
  [[nodiscard]] std::vector<wire::WorkerId> workers() const;

  /// Addresses the next message to a known worker: writes its session and an ascending number.
  /// @pre address_of(worker) is not null.
  void address(wire::WorkerId worker, proto::Envelope& message);

  void forget(wire::WorkerId worker);

  /// Ignores the connection from now on.
  void close_out(const std::string& routing_id);
  [[nodiscard]] bool is_closed_out(const std::string& routing_id) const;

  /// Forgets strangers, once there are too many peers.
  void limit(const std::function<bool(wire::WorkerId)>& is_registered);

 private:
  struct Peer {
    wire::SessionId session;
    Address address;
    std::uint64_t newest_sequence = 0;  ///< Of what was heard.
    std::uint64_t num_sent = 0;
  };

  Limits limits_;
  std::uint64_t next_ = 1;
  std::map<wire::WorkerId, Peer> peers_;
  std::unordered_map<std::uint64_t, wire::WorkerId> by_session_;
  std::unordered_map<std::string, wire::WorkerId> by_routing_id_;
  std::set<std::string> closed_out_;
};

/// Encoded definitions of the campaigns that workers asked for last: each is encoded once for all
/// of them, and again after the campaign was extended.
class DefinitionCache {
 public:
  /// Bytes that are kept: with the newest one at most this and definition_size_max.
  static constexpr std::size_t default_size_max = wire::definition_size_max;

  explicit DefinitionCache(std::size_t size_max = default_size_max) : size_max_(size_max) {}

  /// The part of a campaign's definition that starts at the offset, or at 0 if that is beyond the
  /// end. @pre The definition was accepted as a submission: it is not too large.
  [[nodiscard]] proto::DefinitionPart part(wire::CampaignId campaign, std::uint64_t offset,
                                           const std::shared_ptr<const Campaign>& definition);

  [[nodiscard]] std::uint64_t num_encoded() const { return num_encoded_; }  ///< So far.
  [[nodiscard]] std::size_t size() const { return size_; }                  ///< Bytes kept.

 private:
  struct Entry {
    std::shared_ptr<const Campaign> definition;  ///< Shared with the dispatch: the one encoded.
    wire::EncodedDefinition encoded;
    std::uint64_t used = 0;  ///< Grows with each use: the smallest is the longest ago.
  };

  void make_room();

  std::size_t size_max_;
  std::size_t size_ = 0;
  std::uint64_t num_uses_ = 0;
  std::uint64_t num_encoded_ = 0;
  std::map<wire::CampaignId, Entry> entries_;
};

/// Stands between the workers' socket and the dispatch: checks sender and form of each message,
/// calls the dispatch's function for it, and addresses what goes out. It knows neither socket nor
/// clock.
///
/// A peer that violates the protocol gets one error and is then ignored on that connection.
class WorkerGateway {
 public:
  /// What it needs from the service.
  struct Callbacks {
    /// Hands bytes to a connection; false if it is gone or its queue is full.
    std::function<bool(const std::string& routing_id, const std::string& bytes)> transmit;
    /// True if the public key is authorized, and has not been revoked.
    std::function<bool(const std::string& key, TimePoint now)> is_allowed;
  };

  /// @param state  Outlives the gateway.
  WorkerGateway(State& state, wire::Epoch epoch, Callbacks callbacks);

  void receive(const Incoming& message, TimePoint now, Outbox& outbox);

  /// Carries out Outbox::send(). A message for which the connection has no room is dropped and
  /// counted: the dispatch is made for that.
  void send(WorkerId worker, proto::Envelope message);

  /// Carries out Outbox::send_definition().
  void send_definition(WorkerId worker, wire::CampaignId campaign, std::uint64_t offset,
                       const std::shared_ptr<const Campaign>& definition);

  /// Ends the sessions of workers whose keys were revoked, and forgets strangers once there are too
  /// many. To be called about once a second.
  void review(TimePoint now, Outbox& outbox);

  [[nodiscard]] const Peers& peers() const { return peers_; }
  /// Messages that were dropped.
  [[nodiscard]] std::uint64_t num_unsent() const { return num_unsent_; }

 private:
  /// Null if it is none of a worker: then the peer is closed out.
  [[nodiscard]] const proto::Envelope* decode(const Incoming& message,
                                              google::protobuf::Arena& arena, TimePoint now,
                                              Outbox& outbox);
  void close_out(const Address& from, proto::RejectReason reason, const std::string& text,
                 TimePoint now, Outbox& outbox);
  void transmit(const Address& to, proto::Envelope message);

  State& state_;
  wire::Epoch epoch_;
  Callbacks callbacks_;
  Peers peers_;
  DefinitionCache definitions_;
  std::uint64_t num_unsent_ = 0;
};

}  // namespace proofmass::coordinator
