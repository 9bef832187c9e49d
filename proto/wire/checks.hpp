#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "proto/wire/codec.hpp"
#include "proto/wire/messages.hpp"

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

/// Decodes any bytes.
/// @param check  Looks at the message, which was parsed; what it throws is the fault `invalid`.
/// @return Why the bytes are no such message, if so.
[[nodiscard]] std::optional<DecodeError> read(
    std::string_view bytes, const Form& form, google::protobuf::Message& message,
    const std::function<std::optional<DecodeError>()>& check);
/// What is wrong with an envelope, whatever it holds.
[[nodiscard]] std::optional<DecodeError> fault_of_envelope(const Form& form, std::uint32_t version,
                                                           bool is_empty);
[[nodiscard]] DecodeError too_large(const Form& form, std::size_t size);

/// @throws InvalidArgument if the message has more bytes than its form allows.
[[nodiscard]] std::string bytes_of(const google::protobuf::Message& message, const Form& form);
template <typename Envelope>
[[nodiscard]] std::string envelope_bytes(Envelope& envelope, const Form& form) {
  envelope.set_protocol_version(protocol_version);
  return bytes_of(envelope, form);
}

// What decoders require of values that a peer sent. They throw; decode() and its like turn that
// into a DecodeError.

/// @throws ConfigError unless the condition holds.
void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule);

/// @throws ConfigError unless the value is in [minimum, maximum].
void require_in(std::uint64_t value, std::uint64_t minimum, std::uint64_t maximum,
                std::string_view field);

/// @throws ConfigError unless a list has `minimum` to `maximum` entries.
void require_count(int count, std::uint64_t minimum, std::uint64_t maximum, std::string_view field);

/// @throws ConfigError unless is_name() holds.
void require_name(const std::string& name, std::string_view field);

/// @throws ConfigError unless the names of cards are printable ASCII of cards_text_size_max bytes
/// at most.
void require_cards(const std::string& cards);

/// @throws ConfigError unless the value is finite and in [0, maximum].
void require_magnitude(double value, std::string_view field,
                       double maximum = std::numeric_limits<double>::max());

/// @throws ConfigError if it is 0.
void require_id(std::uint64_t id, std::string_view field);

/// The text, cut to 400 bytes, with `?` for all but printable ASCII: for logs and for the peer, as
/// parts may come from that peer.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace proofmass::wire::detail
