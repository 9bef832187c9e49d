#pragma once

#include <chrono>
#include <string>

#include "coordinator/dispatch/outbox.hpp"

namespace proofmass::coordinator {

/// An event as one line of JSON: `time` (UTC), `level`, `event`, and each `key=value` of its text
/// as a string of its own; what is no such pair is in `text`.
[[nodiscard]] std::string json_line(const Event& event, std::chrono::system_clock::time_point time);

/// `info`, `warning`, `error`.
[[nodiscard]] std::string_view name_of(Severity severity);

}  // namespace proofmass::coordinator
