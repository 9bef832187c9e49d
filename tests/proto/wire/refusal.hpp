#pragma once

#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <concepts>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/definition_codec.hpp"

namespace proofmass::wire::test {

// Messages that break a rule. They are written as protobuf's text: a good message, and what one
// change of it leads to.

/// A change of a good message, and why it is refused then.
struct BadChange {
  /// Fields that are set or, in lists, added. A list that is named first, as in `-runs`, is emptied
  /// before that.
  std::string change;
  std::string refusal;
};

/// The rule of names, as it stands behind a value.
inline const std::string name_rule =
    " bytes (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)";

/// A text that often.
inline std::string times(int count, std::string_view text) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

/// A string of so many characters, in quotes.
inline std::string string_of(int size) {
  return '"' + std::string(static_cast<std::size_t>(size), 'x') + '"';
}

/// What is wrong with the bytes of a message; `accepted` if nothing.
template <typename Message>
DecodeError refusal_of(const std::string& bytes) {
  const auto reason = [](const auto& decoded) {
    const auto* const error = std::get_if<DecodeError>(&decoded);
    return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
  };
  if constexpr (std::same_as<Message, proto::RequestEnvelope>) return reason(decode_request(bytes));
  if constexpr (std::same_as<Message, proto::ReplyEnvelope>) return reason(decode_reply(bytes));
  if constexpr (std::same_as<Message, proto::Envelope>) return reason(decode(bytes));
  try {
    (void)decode_definition(bytes);
    return {DecodeFault::invalid, "accepted"};
  } catch (const Error& error) {
    return {DecodeFault::invalid, error.what()};
  }
}

template <typename Message>
DecodeError refusal_of(const Message& message) {
  return refusal_of<Message>(message.SerializeAsString());
}

/// The message that a field holds, of a list the first one; at `a.b` the one in that one.
inline google::protobuf::Message& message_at(google::protobuf::Message& message,
                                             std::string_view path) {
  if (path.empty()) return message;
  const std::string name(path.substr(0, path.find('.')));
  path.remove_prefix(std::min(path.size(), name.size() + 1));
  const auto* const field = message.GetDescriptor()->FindFieldByName(name);
  const auto& fields = *message.GetReflection();
  return message_at(field->is_repeated() ? *fields.MutableRepeatedMessage(&message, field, 0)
                                         : *fields.MutableMessage(&message, field),
                    path);
}

/// @param text  As BadChange::change.
inline void merge_text(std::string_view text, google::protobuf::Message& message) {
  if (text.starts_with('-')) {
    const std::string name(text.substr(1, text.find(' ') - 1));
    message.GetReflection()->ClearField(&message, message.GetDescriptor()->FindFieldByName(name));
    text.remove_prefix(std::min(text.size(), name.size() + 2));
  }
  google::protobuf::TextFormat::Parser parser;
  google::protobuf::io::ArrayInputStream stream(text.data(), static_cast<int>(text.size()));
  EXPECT_TRUE(parser.Merge(&stream, &message)) << text.substr(0, 200);
}

/// @param good  An envelope without its number and version, or a definition.
template <typename Message>
Message message_of(const std::string& good) {
  Message message;
  merge_text(good, message);
  if constexpr (requires { message.set_protocol_version(protocol_version); }) {
    message.set_protocol_version(protocol_version);
  }
  if constexpr (requires { message.set_session(1); }) message.set_session(1);
  if constexpr (requires { message.set_request_id(1); }) message.set_request_id(1);
  return message;
}

/// Changes the message at a path of a good one, see message_at(), and expects what is said of it.
template <typename Message>
void expect_refusals(const std::string& good, std::string_view path,
                     const std::vector<BadChange>& changes) {
  const auto unchanged = message_of<Message>(good);
  EXPECT_EQ(refusal_of(unchanged).text, "accepted") << good;
  for (const auto& [change, refusal] : changes) {
    Message changed = unchanged;
    merge_text(change, message_at(changed, path));
    const DecodeError error = refusal_of(changed);
    EXPECT_EQ(error.text, refusal) << change.substr(0, 200);
    EXPECT_EQ(error.fault, DecodeFault::invalid);
  }
}

}  // namespace proofmass::wire::test
