#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

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

/// Events that a HandshakeWatch looks for: ZMQ_EVENT_..., joined by |.
extern const int failed_handshakes;

/// Notices peers whose handshake ends before they show a key: those that use none, that trust
/// another coordinator's key, or that speak another protocol. ZeroMQ does not report their address.
class HandshakeWatch {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;
  /// The next event of a socket, if there is one.
  using EventSource = std::function<std::optional<wire::SocketEvent>()>;

  /// @param log  Outlives the watch.
  HandshakeWatch(EventSource next_event, wire::Domain domain, RefusalLog& log)
      : next_event_(std::move(next_event)), domain_(domain), log_(log) {}

  /// Logs what happened; never waits.
  void update(TimePoint now);

 private:
  EventSource next_event_;
  wire::Domain domain_;
  RefusalLog& log_;
};

}  // namespace proofmass::coordinator
