#include "proto/wire/field_count.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <cstdint>

namespace proofmass::wire::detail {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;
using Stream = google::protobuf::io::CodedInputStream;

/// The type of the message that a field holds; null if it holds none.
const Descriptor* content_type(const Descriptor& type, std::uint32_t tag) {
  if (WireFormatLite::GetTagWireType(tag) != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
    return nullptr;
  }
  const FieldDescriptor* const field =
      type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
  return field == nullptr ? nullptr : field->message_type();
}

bool skip(Stream& stream, std::uint32_t tag) {
  // Groups, of which no message has any, would hide the fields inside them.
  const bool is_group = WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_START_GROUP;
  return !is_group && WireFormatLite::SkipField(&stream, tag);
}

/// Takes the fields of the message from `count_left`; false if there are more, or the bytes make no
/// sense. No message holds one of its own type, so the depth is bounded.
bool count_down(Stream& stream, const Descriptor& type, std::size_t& count_left) {
  while (const std::uint32_t tag = stream.ReadTag()) {
    if (count_left == 0) return false;
    --count_left;
    const Descriptor* const inner = content_type(type, tag);
    if (inner == nullptr) {
      if (!skip(stream, tag)) return false;
      continue;
    }
    const Stream::Limit limit = stream.ReadLengthAndPushLimit();
    if (!count_down(stream, *inner, count_left)) return false;
    stream.PopLimit(limit);
  }
  return stream.ConsumedEntireMessage();
}

}  // namespace

bool has_fields_at_most(std::string_view bytes, const Descriptor& type, std::size_t count_max) {
  Stream stream(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                static_cast<int>(bytes.size()));
  return count_down(stream, type, count_max);
}

}  // namespace proofmass::wire::detail
