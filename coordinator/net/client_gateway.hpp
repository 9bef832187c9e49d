#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/router_socket.hpp"
#include "coordinator/net/server_paths.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// What a client asks for, ready to be carried out.
struct Request {
  proto::RequestEnvelope message;  ///< It has been checked.
  /// Of a submission: what its definition says, which the message does not hold any more. Valid,
  /// with its table columns; shared with the work that stores it.
  std::shared_ptr<const Campaign> campaign = nullptr;
};

/// @throws DefinitionError if a submission's definition is not one.
[[nodiscard]] Request request_of(proto::RequestEnvelope message);

/// Joins requests that are too large for one message from their parts. A connection has one such
/// request at a time: the first part of another one replaces it.
class RequestParts {
 public:
  /// All bytes of a request, once all of its parts are here; before, what to reply.
  using Outcome = std::variant<std::string, proto::ReplyEnvelope>;

  /// @param size_max  Of all requests together, bytes. Room for a request is taken with its first
  ///                  part.
  explicit RequestParts(std::size_t size_max = 2 * wire::submit_size_max) : size_max_(size_max) {}

  /// @param connection  Its routing id.
  [[nodiscard]] Outcome take(const std::string& connection, std::uint64_t request,
                             const proto::RequestPart& part, TimePoint now);

  /// The bytes of a whole request have been read and freed.
  void release(std::size_t size);

  /// Drops requests of which no part came for half a minute.
  void drop_stale(TimePoint now);

  [[nodiscard]] std::size_t size_held() const { return size_held_; }

 private:
  struct Unfinished {
    std::uint64_t request = 0;
    std::size_t total_size = 0;
    std::string bytes;
    TimePoint heard_at;
  };
  using Connections = std::map<std::string, Unfinished>;

  Connections::iterator drop(Connections::iterator connection);

  std::size_t size_max_;
  std::size_t size_held_ = 0;  ///< Counted by total_size; with whole ones until release().
  Connections unfinished_;
};

/// Stands between the clients' socket and the RequestService: checks messages, reads large requests
/// in the background, and sends each reply to all connections that wait for it. It knows no socket.
/// Nothing that a client sends makes one of its functions throw.
class ClientGateway {
 public:
  /// What it needs from the service.
  struct Callbacks {
    /// Hands bytes to a connection, which may be gone.
    std::function<void(const std::string& routing_id, const std::string& bytes)> transmit;
    /// The client that has the key; nothing if the key is not authorized, or not any more.
    std::function<std::optional<Asker>(const std::string& key)> asker_of;
    /// Carries out a request that has been checked. May throw instead of responding.
    std::function<void(Request request, const Asker& asker, Respond respond)> carry_out;
    std::function<TimePoint()> now;
    ServerPaths paths;  ///< Which no reply has.
  };

  /// How many connections may wait for the same request, for example one client that connects
  /// again.
  static constexpr std::size_t waiters_max = 16;

  /// @param background  Outlives the gateway.
  ClientGateway(Background& background, Callbacks callbacks);

  /// Handles one message, anything at all.
  void receive(const Incoming& message);

  /// Tells clients that wait that their request is being carried out. To be called several times a
  /// second.
  void review();

 private:
  /// Where a reply goes.
  struct Waiter {
    std::string routing_id;
    std::uint64_t request = 0;
  };

  /// A request that is being carried out. A repetition of it joins those who wait.
  struct Pending {
    std::string key;
    std::size_t size = 0;
    std::size_t hash = 0;  ///< With key and size: of the bytes.
    std::vector<Waiter> waiters;
    TimePoint told_at;
  };

  void take(const Incoming& message);
  void take_part(const Address& from, std::uint64_t request, const proto::RequestPart& part);
  void take_whole(const Address& from, std::uint64_t request, std::string bytes);
  /// @param take_request  May throw the reason why there is none.
  void carry_out(std::uint64_t ticket, const std::string& key,
                 const std::function<Request()>& take_request);
  /// @throws Error if the key is not authorized any more.
  [[nodiscard]] Asker asker_of(const std::string& key) const;
  /// Lets a waiter join those of a request that is being carried out already.
  /// @return The ticket of a request that is not; nothing otherwise.
  std::optional<std::uint64_t> begin(const Address& from, std::uint64_t request,
                                     std::string_view bytes);
  void respond(std::uint64_t ticket, const proto::ReplyEnvelope& reply);
  void send(const Waiter& waiter, proto::ReplyEnvelope reply);

  Background& background_;
  Callbacks callbacks_;
  RequestParts parts_;
  std::map<std::uint64_t, Pending> pending_;  ///< By ticket.
  std::uint64_t next_ticket_ = 1;
};

}  // namespace proofmass::coordinator
