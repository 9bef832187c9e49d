#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <variant>

#include "proto/proofmass.pb.h"
#include "proto/wire/codec.hpp"

namespace proofmass::wire::test {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

inline constexpr Header good_header{.session = {1}, .epoch = {2}, .sequence = 3};

inline DecodeError refusal_of(const std::string& bytes) {
  const auto decoded = decode(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
}

/// Why the message is refused after the change.
inline std::string refusal(const Message& good,
                           const std::function<void(proto::Envelope&)>& change) {
  proto::Envelope envelope;
  EXPECT_TRUE(envelope.ParseFromString(encode({.header = good_header, .message = good})));
  change(envelope);
  const DecodeError error = refusal_of(envelope.SerializeAsString());
  EXPECT_EQ(error.fault, DecodeFault::invalid);
  return error.text;
}

}  // namespace proofmass::wire::test
