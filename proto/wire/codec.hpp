#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "proto/wire/messages.hpp"

namespace proofmass::wire {

/// Size limits of an encoded definition and of an encoded message, bytes. A definition travels in
/// parts.
inline constexpr std::size_t definition_size_max = std::size_t{64} << 20;
inline constexpr std::size_t message_size_max = std::size_t{4} << 20;

/// What a coordinator's socket takes at once, bytes. A peer that has shown no key yet may fill a
/// buffer of this size. 4096 results, the largest message of a worker, need 0.8 MiB.
inline constexpr std::size_t router_message_size_max = std::size_t{1} << 20;

enum class DecodeFault : std::uint8_t {
  too_large,      ///< More bytes than its kind may have.
  unparsable,     ///< Not an envelope.
  wrong_version,  ///< Another protocol version.
  empty,          ///< An envelope without a message of a known kind.
  invalid,        ///< A message with a value that the rules forbid.
};

/// Why bytes are not a message.
struct DecodeError {
  DecodeFault fault = DecodeFault::unparsable;
  std::string text;  ///< `field = value (rule)`, for logs and for the peer.
};

/// The bytes of a message.
/// @throws InvalidArgument if they are more than the message may have.
[[nodiscard]] std::string encode(const Packet& packet);

/// Checks everything: sizes, counts, enumerators, that numbers are finite. What it returns can be
/// used without further checks of form.
///
/// @param bytes  Anything at all, from anybody.
[[nodiscard]] std::variant<Packet, DecodeError> decode(std::string_view bytes);

}  // namespace proofmass::wire
