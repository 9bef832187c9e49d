#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a coordinator replied, for programs: a JSON object with stable keys, units in their names.
// README.md lists them.

/// Object on one line or on several; ends with the end of a line.
enum class JsonLayout : std::uint8_t { one_line, indented };

[[nodiscard]] std::string status_json(const wire::StatusReply& status, JsonLayout layout);
[[nodiscard]] std::string workers_json(const wire::WorkersReply& workers);

/// @param action    What was asked for: `pause`, `submit`.
/// @param campaign  Its name.
[[nodiscard]] std::string done_json(std::string_view action, std::string_view campaign,
                                    const wire::DoneReply& done);
[[nodiscard]] std::string released_json(std::string_view host, const wire::DoneReply& done);

}  // namespace proofmass::coordinator
