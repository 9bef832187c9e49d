#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass::wire {

enum class LogFormat : std::uint8_t {
  text,  ///< For people.
  json,  ///< One object a line, for programs.
};

/// What is written at all.
enum class LogLevel : std::uint8_t { info, warning };

/// From now on the log goes to standard error, each message as one line of visible_text(). To be
/// called once, by the only thread.
void set_up_log(const std::string& program, LogFormat format, LogLevel level);

/// A log message such as `worker_crashed signal=11 restart_in_s=1.0` as one line of JSON: `time`
/// (UTC), `level`, `event`, and each `key=value` as a string of its own; what is no such pair, or
/// has a name that is taken, is in `text`.
[[nodiscard]] std::string json_line(std::string_view message, std::string_view level,
                                    std::chrono::system_clock::time_point time);

}  // namespace proofmass::wire
