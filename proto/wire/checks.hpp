#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "proto/wire/codec.hpp"

namespace google::protobuf {
class Message;
}  // namespace google::protobuf

namespace proofmass::wire::detail {

/// What is encoded, and its limits.
struct Form {
  std::string_view name;  ///< For messages: `request`.
  std::string_view kind;  ///< `an envelope`.
  std::size_t size_max;   ///< Bytes.
  /// Fields, those of the messages inside it included; an array of numbers is one. Parsing takes
  /// some hundred bytes of memory a field, and a field may take two bytes: without this, a message
  /// within its limit of size could cost fifty times that limit.
  std::size_t fields_max;
  bool is_always_counted = true;  ///< Counting takes as long as parsing.
};

/// Parses any bytes; of an envelope also looks at its version and whether there is one message in
/// it.
/// @return Why the bytes are no such message, if so.
[[nodiscard]] std::optional<DecodeError> parse(std::string_view bytes, const Form& form,
                                               google::protobuf::Message& message);
/// Which rule a message breaks, if so: see check_rules().
[[nodiscard]] std::optional<DecodeError> fault_in(const google::protobuf::Message& message);
[[nodiscard]] DecodeError too_large(const Form& form, std::size_t size);

/// @throws InvalidArgument if the message has more bytes than its form allows.
[[nodiscard]] std::string bytes_of(const google::protobuf::Message& message, const Form& form);
template <typename Envelope>
[[nodiscard]] std::string envelope_bytes(Envelope& envelope, const Form& form) {
  envelope.set_protocol_version(protocol_version);
  return bytes_of(envelope, form);
}

/// The text, cut to 400 bytes, with `?` for all but printable ASCII: for logs and for the peer, as
/// parts may come from that peer.
[[nodiscard]] std::string printable(std::string_view text);

// What a field may be: rules.cpp.

/// Whether a message, and those in it, are what a peer may send: numbers and sizes are within their
/// limits, enumerators are known, names are names, lists have as many entries as others say.
/// @throws ConfigError reading `field = value (rule)`.
void check_rules(const google::protobuf::Message& message);

/// Makes each text of a message, and of those in it, one that may be sent: a name a name, what goes
/// to a terminal no longer than that may be and printable. A number that is not finite or negative
/// becomes 0. Fields of bytes stay as they are.
void make_sendable(google::protobuf::Message& message);

}  // namespace proofmass::wire::detail
