#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/definition_cache.hpp"
#include "coordinator/net/peers.hpp"

namespace proofmass::coordinator {

/// A message as it comes out of a socket.
struct Incoming {
  Address from;
  std::vector<std::string_view> frames;  ///< Valid while the message is handled.
};

/// Between the workers' socket and the dispatch: checks who speaks and whether what they say has
/// the right form, calls the function of the event, and addresses what goes out. Knows neither
/// socket nor clock.
///
/// A peer that violates the protocol gets one error and is then ignored on that connection.
class WorkerGateway {
 public:
  /// What it needs from the service.
  struct Surroundings {
    /// Hands bytes to a connection; false if it is gone or its queue is full.
    std::function<bool(const std::string& routing_id, const std::string& bytes)> transmit;
    /// Whether a public key may speak (still).
    std::function<bool(const std::string& key, TimePoint now)> is_allowed;
    /// Told why a worker leaves, before the dispatch is.
    std::function<void(WorkerId worker, LossReason reason)> on_leaving;
  };

  /// @param state  Outlives the gateway.
  WorkerGateway(State& state, wire::Epoch epoch, Surroundings surroundings);

  void receive(const Incoming& message, TimePoint now, Outbox& outbox);

  /// Carries out Outbox::send(). What the connection has no room for is lost and counted: the
  /// dispatch is made for that.
  void send(WorkerId worker, wire::Message message);

  /// Carries out Outbox::send_definition().
  void send_definition(WorkerId worker, const wire::CampaignRequest& request,
                       const std::shared_ptr<const Campaign>& definition);

  /// Ends the sessions of workers whose keys were revoked, and forgets strangers once there are too
  /// many. To be called about once a second.
  void review(TimePoint now, Outbox& outbox);

  [[nodiscard]] const Peers& peers() const { return peers_; }
  /// Messages that found no room.
  [[nodiscard]] std::uint64_t num_unsent() const { return num_unsent_; }

 private:
  [[nodiscard]] std::optional<wire::Packet> decode(const Incoming& message, TimePoint now,
                                                   Outbox& outbox);
  void close_out(const Address& from, wire::RejectReason reason, const std::string& text,
                 TimePoint now, Outbox& outbox);
  void send_packet(const Address& to, const wire::Packet& packet);

  State& state_;
  wire::Epoch epoch_;
  Surroundings surroundings_;
  Peers peers_;
  DefinitionCache definitions_;
  std::uint64_t num_unsent_ = 0;
};

}  // namespace proofmass::coordinator
