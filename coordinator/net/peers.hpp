#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class Envelope;
}  // namespace proofmass::proto

namespace proofmass::coordinator {

/// Where a message came from, as the transport has it.
struct Address {
  std::string routing_id;  ///< Of the connection; another one after each reconnection.
  std::string key;         ///< Public key in Z85; empty on a connection without keys.
  /// For people: `10.0.0.7`, or `localhost:UID:GID:PID` on a Unix domain socket; may be empty.
  std::string host;
};

/// A message as it comes out of a socket.
struct Incoming {
  Address from;
  std::vector<std::string_view> frames;  ///< Valid while the message is handled.
};

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

}  // namespace proofmass::coordinator
