#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"

namespace zmq {
class context_t;
class socket_t;
}  // namespace zmq

namespace proofmass::coordinator {

/// A peer that asks ZeroMQ to be let in.
struct Handshake {
  std::string id = {};  ///< Of the question.
  std::string domain;
  std::string address = {};     ///< Of the peer; empty if it is not known.
  std::string public_key = {};  ///< Z85; empty if it has shown none.
};

/// Logs refusals, but not a flood of them: a peer is logged once a minute for the same reason, and
/// at most 20 lines a minute are written in all. The other refusals are counted.
class RefusalLog {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit RefusalLog(Log log);

  void refused(const Handshake& peer, std::string_view reason, TimePoint now);

 private:
  void begin_minute(TimePoint now);

  Log log_;
  TimePoint began_at_;
  std::set<std::string> lines_;  ///< Of this minute.
  std::uint64_t num_left_out_ = 0;
};

/// Events of handshakes that failed: ZMQ_EVENT_..., joined by |.
extern const int failed_handshakes;

/// Why a handshake failed, for people.
[[nodiscard]] std::string_view reason_of(const wire::SocketEvent& failure);

/// Decides who may connect, by the ZAP protocol [ZeroMQ RFC 27]: a worker whose key is in
/// authorized_workers, at the workers' address; a client whose key is in authorized_clients, at the
/// clients' address. It has no thread: the service's loop calls serve() to answer handshakes.
///
/// The user id of an admitted peer is its public key: `message.gets("User-Id")` gives it with each
/// message, and is_allowed() says whether it may still speak.
class Authenticator {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// Must be made before any socket of the context is bound.
  ///
  /// @param directory  With authorized_workers and authorized_clients.
  /// @param log        Refusals, and lists that changed or cannot be read.
  /// @throws Error if a list cannot be read, or if the context has an authenticator.
  Authenticator(zmq::context_t& context, const std::filesystem::path& directory, Log log);
  ~Authenticator();

  /// Socket to poll for ZMQ_POLLIN, as in zmq::pollitem_t; then call serve().
  [[nodiscard]] void* handle() const;

  /// What happened to the socket of a domain: logs a peer whose handshake ended before it showed a
  /// key, one that uses none, that trusts another coordinator's key, or that speaks another
  /// protocol. ZeroMQ does not report its address.
  void on_event(wire::KeyRole role, const wire::SocketEvent& event, TimePoint now);

  /// Answers all handshakes that wait, and reads the lists again that changed, once a second at
  /// most. To be called several times a second, also while nobody connects or speaks: a key is
  /// revoked by two looks. Never waits itself.
  void serve(TimePoint now);

  /// True if the key is on the domain's list, which is read again when it changed, once a second at
  /// most. To be asked at every message: a revoked key keeps its connection otherwise.
  [[nodiscard]] bool is_allowed(wire::KeyRole role, std::string_view public_key, TimePoint now);

  /// Name and rights of a client's key, as is_allowed(); nothing if it is not on the list.
  [[nodiscard]] std::optional<Asker> client(std::string_view public_key, TimePoint now);

 private:
  [[nodiscard]] AllowList& list_of(wire::KeyRole role);
  void answer(const Handshake& handshake, TimePoint now);
  /// Why the peer is refused; empty if it is admitted.
  [[nodiscard]] std::string_view refusal(const Handshake& handshake, TimePoint now);
  /// @param status  200: welcome; 400: not.
  void reply(std::string_view id, std::string_view status, std::string_view text,
             std::string_view user_id);

  RefusalLog refusals_;
  AllowList workers_;
  AllowList clients_;
  std::unique_ptr<zmq::socket_t> socket_;
};

}  // namespace proofmass::coordinator
