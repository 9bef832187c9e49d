#include "proto/wire/checks.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/wire_format_lite.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/wire/names.hpp"

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

std::optional<DecodeError> read(std::string_view bytes, const Form& form,
                                google::protobuf::Message& message,
                                const std::function<std::optional<DecodeError>()>& check) {
  silence_protobuf();
  if (bytes.size() > form.size_max) return too_large(form, bytes.size());
  // A field takes two bytes or more, so that a short message cannot have too many.
  const bool is_counted = form.is_always_counted || bytes.size() / 2 > form.fields_max;
  const bool has_few =
      !is_counted || has_fields_at_most(bytes, *message.GetDescriptor(), form.fields_max);
  const bool is_parsed =
      has_few && message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!is_parsed) {
    return DecodeError{DecodeFault::unparsable,
                       fmt::format("{} = {} bytes (must be {} of at most {} fields)", form.name,
                                   bytes.size(), form.kind, form.fields_max)};
  }
  try {
    return check();
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, printable(error.what())};
  }
}

std::optional<DecodeError> fault_of_envelope(const Form& form, std::uint32_t version,
                                             bool is_empty) {
  if (version != protocol_version) {
    return DecodeError{DecodeFault::wrong_version, fmt::format("protocol_version = {} (must be {})",
                                                               version, protocol_version)};
  }
  if (!is_empty) return std::nullopt;
  return DecodeError{DecodeFault::empty,
                     fmt::format("{} = none (must be of a known kind)", form.name)};
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

void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule) {
  if (!condition) throw ConfigError(field, value, rule);
}

void require_in(std::uint64_t value, std::uint64_t minimum, std::uint64_t maximum,
                std::string_view field) {
  // Texts are made for a refusal only: a batch of results calls this thousands of times.
  if (value >= minimum && value <= maximum) return;
  throw ConfigError(field, fmt::format("{}", value),
                    fmt::format("must be in [{}, {}]", minimum, maximum));
}

void require_count(int count, std::uint64_t minimum, std::uint64_t maximum,
                   std::string_view field) {
  const auto size = static_cast<std::uint64_t>(count);
  if (size >= minimum && size <= maximum) return;
  throw ConfigError(field, fmt::format("{} entries", count),
                    fmt::format("must be in [{}, {}]", minimum, maximum));
}

void require_name(const std::string& name, std::string_view field) {
  // The name itself is not repeated: it may hold anything.
  require(is_name(name), field, fmt::format("{} bytes", name.size()), is_name_rule);
}

void require_cards(const std::string& cards) {
  require_in(cards.size(), 0, cards_text_size_max, "size of cards");
  require(printable(cards) == cards, "cards", printable(cards), "must be printable ASCII");
}

void require_magnitude(double value, std::string_view field, double maximum) {
  if (value >= 0.0 && value <= maximum) return;
  const bool is_too_large = value > maximum && std::isfinite(value);
  throw ConfigError(field, fmt::format("{}", value),
                    is_too_large ? fmt::format("must be <= {}", maximum) : "must be >= 0");
}

void require_id(std::uint64_t id, std::string_view field) {
  require(id != 0, field, "0", "must not be 0");
}

std::string printable(std::string_view text) {
  constexpr std::size_t length_max = 400;
  std::string result(text.substr(0, length_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return result;
}

}  // namespace proofmass::wire::detail
