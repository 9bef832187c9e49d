#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

// How a coordinator stands, for programs: JSON objects with stable keys, units in their names.
// coordinator/cli/README.md lists them.

/// Object on one line or on several; ends with the end of a line.
enum class JsonLayout : std::uint8_t { one_line, indented };

/// The text of an object. Bytes of it that are not UTF-8 are replaced by U+FFFD.
[[nodiscard]] std::string dumped(const nlohmann::ordered_json& json, JsonLayout layout);

[[nodiscard]] std::string status_json(const proto::StatusReply& status, JsonLayout layout);
[[nodiscard]] std::string workers_json(const proto::WorkersReply& workers);

}  // namespace proofmass::coordinator
