#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace google::protobuf {
class Descriptor;
}  // namespace google::protobuf

namespace proofmass::wire::detail {

/// True if bytes that claim to be a message of this type hold at most `count_max` fields, those of
/// the messages inside it included; false also if they cannot be parsed.
///
/// Parsing takes some hundred bytes of memory a field, and a field may take two bytes: without
/// this, a message within its limit of size could cost fifty times that limit. An array of numbers
/// is one field.
[[nodiscard]] bool has_fields_at_most(std::string_view bytes,
                                      const google::protobuf::Descriptor& type,
                                      std::size_t count_max);

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

/// The name. @throws ConfigError unless is_name() holds.
[[nodiscard]] std::string checked_name(const std::string& name, std::string_view field);

/// @throws ConfigError unless the names of cards are printable ASCII of cards_text_size_max bytes
/// at most.
void require_cards(const std::string& cards);

/// The value. @throws ConfigError unless it is finite and ≥ 0.
[[nodiscard]] double checked_magnitude(double value, std::string_view field);

/// The number. @throws ConfigError if it is 0.
[[nodiscard]] std::uint64_t checked_id(std::uint64_t id, std::string_view field);

/// The text, cut to 400 bytes, with `?` for all but printable ASCII: for logs and for the peer, as
/// parts may come from that peer.
[[nodiscard]] std::string printable(std::string_view text);

/// From now on Protobuf does not write to standard error what is wrong with a peer's bytes.
void silence_protobuf();

}  // namespace proofmass::wire::detail
