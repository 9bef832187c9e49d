#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "proto/text/event.hpp"

namespace proofmass::wire {

enum class LogFormat : std::uint8_t {
  text,  ///< For people.
  json,  ///< One object a line, for programs.
};

/// What is written at all.
enum class LogLevel : std::uint8_t { info, warning };

/// A log that writes events to standard error, one line each: to_text() behind time, program and
/// severity, or json_line(). Any thread may call it.
[[nodiscard]] Log make_log(const std::string& program, LogFormat format, LogLevel level);

/// The event as one line of JSON: `time` (UTC), `level`, `event`, each field with its name, and the
/// remarks in `text`. Counts and numbers are numbers; text is what the field holds, except that
/// bytes that are not UTF-8 are replaced by U+FFFD.
[[nodiscard]] std::string json_line(const Event& event, std::chrono::system_clock::time_point time);

}  // namespace proofmass::wire
