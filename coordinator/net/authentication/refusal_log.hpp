#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>

#include "coordinator/dispatch/outbox.hpp"
#include "proto/link/connection_monitor.hpp"

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

/// Events of handshakes that failed: ZMQ_EVENT_..., joined by |.
extern const int failed_handshakes;

/// Why a handshake failed, for people.
[[nodiscard]] std::string_view reason_of(const wire::SocketEvent& failure);

}  // namespace proofmass::coordinator
