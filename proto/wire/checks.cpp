#include "proto/wire/checks.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "core/error.hpp"

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

bool has_fields_at_most(std::string_view bytes, const Descriptor& type, std::size_t count_max) {
  Stream stream(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                static_cast<int>(bytes.size()));
  return count_down(stream, type, count_max);
}

/// From now on Protobuf does not write to standard error what is wrong with a peer's bytes.
void silence_protobuf() {
  static const auto former = google::protobuf::SetLogHandler(nullptr);
  (void)former;
}

}  // namespace

std::optional<DecodeError> parse(std::string_view bytes, const Form& form,
                                 google::protobuf::Message& message) {
  silence_protobuf();
  if (bytes.size() > form.size_max) return too_large(form, bytes.size());
  const Descriptor& type = *message.GetDescriptor();
  // A field takes two bytes or more, so that a short message cannot have too many.
  const bool is_counted = form.is_always_counted || bytes.size() / 2 > form.fields_max;
  const bool has_few = !is_counted || has_fields_at_most(bytes, type, form.fields_max);
  if (!has_few || !message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return DecodeError{DecodeFault::unparsable,
                       fmt::format("{} = {} bytes (must be {} of at most {} fields)", form.name,
                                   bytes.size(), form.kind, form.fields_max)};
  }
  const google::protobuf::Reflection& values = *message.GetReflection();
  const FieldDescriptor* const field = type.FindFieldByName("protocol_version");
  if (field == nullptr) return std::nullopt;
  const std::uint32_t version = values.GetUInt32(message, field);
  if (version != protocol_version) {
    return DecodeError{DecodeFault::wrong_version, fmt::format("protocol_version = {} (must be {})",
                                                               version, protocol_version)};
  }
  int count = 0;
  for (int i = 0; i < type.oneof_decl_count(); ++i) {
    if (values.HasOneof(message, type.oneof_decl(i))) ++count;
  }
  if (count == 1) return std::nullopt;
  if (count > 1) {
    return DecodeError{DecodeFault::invalid, fmt::format("{} = two (must be one)", form.name)};
  }
  return DecodeError{DecodeFault::empty,
                     fmt::format("{} = none (must be of a known kind)", form.name)};
}

std::optional<DecodeError> fault_in(const google::protobuf::Message& message) {
  try {
    check_rules(message);
    return std::nullopt;
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, printable(error.what())};
  }
}

DecodeError too_large(const Form& form, std::size_t size) {
  return {DecodeFault::too_large,
          fmt::format("{} size = {} bytes (must be at most {})", form.name, size, form.size_max)};
}

std::string bytes_of(const google::protobuf::Message& message, const Form& form) {
  const std::size_t size = message.ByteSizeLong();
  if (size > form.size_max) throw InvalidArgument(too_large(form, size).text);
  return message.SerializeAsString();
}

std::string printable(std::string_view text) {
  constexpr std::size_t length_max = 400;
  std::string result(text.substr(0, length_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

}  // namespace proofmass::wire::detail
