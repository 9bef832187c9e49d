#pragma once

#include <cstddef>
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

}  // namespace proofmass::wire::detail
