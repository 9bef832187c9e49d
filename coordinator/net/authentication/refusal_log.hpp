#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "coordinator/dispatch/outbox.hpp"
#include "proto/link/connection_monitor.hpp"
#include "proto/link/keys.hpp"

namespace proofmass::coordinator {

/// A peer that was refused.
struct Refusal {
  std::string_view domain;
  std::string_view address;     ///< Of the peer; empty if it is not known.
  std::string_view public_key;  ///< Empty if it has shown none.
  std::string_view reason;
};

/// Logs refusals, but not a flood of them: a peer is logged once a minute for the same reason, and
/// at most 20 lines a minute are written in all. The other refusals are counted.
class RefusalLog {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit RefusalLog(Log log);

  void refused(const Refusal& refusal, TimePoint now);

 private:
  void begin_minute(TimePoint now);

  Log log_;
  TimePoint began_at_;
  std::set<std::string> lines_;  ///< Of this minute.
  std::uint64_t num_left_out_ = 0;
};

/// Events that log_failed_handshakes() looks for: ZMQ_EVENT_..., joined by |.
extern const int failed_handshakes;

/// Gives the next event of a socket, if there is one.
using EventSource = std::function<std::optional<wire::SocketEvent>()>;

/// Logs peers whose handshake ended before they showed a key: those that use none, that trust
/// another coordinator's key, or that speak another protocol. ZeroMQ does not report their address.
/// Never waits.
void log_failed_handshakes(const EventSource& next_event, wire::Domain domain, RefusalLog& log,
                           std::chrono::steady_clock::time_point now);

}  // namespace proofmass::coordinator
