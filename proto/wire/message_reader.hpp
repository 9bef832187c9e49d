#pragma once

#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class Envelope;
}  // namespace proofmass::proto

namespace proofmass::wire::detail {

/// The message in an envelope that has one.
/// @throws ConfigError if a value is forbidden.
[[nodiscard]] Message read_message(const proto::Envelope& envelope);

}  // namespace proofmass::wire::detail
