#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "proto/wire/messages.hpp"

namespace google::protobuf {
class Arena;
}  // namespace google::protobuf

namespace proofmass::proto {
class Envelope;
}  // namespace proofmass::proto

namespace proofmass::wire {

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

/// The bytes of a message. Its version becomes protocol_version.
/// @throws InvalidArgument if they are more than a message may have.
[[nodiscard]] std::string encode(proto::Envelope envelope);

/// Checks everything: sizes, counts, enumerators, that numbers are finite. What it returns can be
/// used without further checks of form; a text for people has printable characters only.
///
/// @param bytes  Anything at all, from anybody.
[[nodiscard]] std::variant<proto::Envelope, DecodeError> decode(std::string_view bytes);
/// In an arena, where the parts of a batch of results, of which there are thousands, are freed at
/// once.
[[nodiscard]] std::variant<const proto::Envelope*, DecodeError> decode(
    std::string_view bytes, google::protobuf::Arena& arena);

}  // namespace proofmass::wire
