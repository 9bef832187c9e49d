#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>

#include "coordinator/dispatch/outbox.hpp"

namespace proofmass::coordinator {

/// A peer that was not let in.
struct Refusal {
  std::string_view domain;
  std::string_view address;     ///< Of the peer; empty if it is not known.
  std::string_view public_key;  ///< Empty if it has shown none.
  std::string_view reason;
};

/// Logs refusals, but not a flood of them: one peer once a minute for the same reason, and 20 lines
/// a minute altogether; the rest is counted.
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

}  // namespace proofmass::coordinator
