#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/request.hpp"
#include "coordinator/net/worker_gateway.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Answers a request, now or later; called once, in the service's thread.
using Respond = std::function<void(wire::ClientReply)>;

/// Between the clients' socket and what carries requests out: puts large requests together from
/// their parts, reads them in the background, and sends each reply to the connections that
/// wait for it. Knows no socket. Nothing that a client sends makes one of its functions throw.
class ClientGateway {
 public:
  /// What it needs from the service.
  struct Surroundings {
    /// Hands bytes to a connection, which may be gone.
    std::function<void(const std::string& routing_id, const std::string& bytes)> transmit;
    /// Who has the key; nothing if it may not speak (any more).
    std::function<std::optional<Asker>(const std::string& key)> asker_of;
    /// Carries out a request that has been checked. May throw instead of responding.
    std::function<void(Request request, const Asker& asker, Respond respond)> carry_out;
    std::function<TimePoint()> now;
  };

  /// How many connections may wait for the same request, for example one client that connects
  /// again.
  static constexpr std::size_t waiters_max = 16;

  /// @param background  Outlives the gateway.
  ClientGateway(Background& background, Surroundings surroundings);

  /// Handles one message, anything at all.
  void receive(const Incoming& message);

  /// Tells those who wait for a reply that it will come. To be called some times a second.
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
  void take_part(const Address& from, std::uint64_t request, const wire::RequestPart& part);
  void take_whole(const Address& from, std::uint64_t request, std::string bytes);
  void carry_out(std::uint64_t ticket, const std::string& key, Request request);
  /// Lets a waiter join those of a request that is being carried out already.
  /// @return The ticket of a request that is not; nothing otherwise.
  std::optional<std::uint64_t> begin(const Address& from, std::uint64_t request,
                                     std::string_view bytes);
  void respond(std::uint64_t ticket, const wire::ClientReply& reply);
  void send(const Waiter& waiter, const wire::ClientReply& reply);

  Background& background_;
  Surroundings surroundings_;
  RequestParts impl_;
  std::map<std::uint64_t, Pending> pending_;  ///< By ticket.
  std::uint64_t next_ticket_ = 1;
};

}  // namespace proofmass::coordinator
