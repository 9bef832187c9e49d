#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/peers.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/definition_codec.hpp"

namespace proofmass::coordinator {

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
