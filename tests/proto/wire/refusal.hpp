#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "proto/proofmass.pb.h"
#include "proto/wire/codec.hpp"
#include "tests/support/messages.hpp"

namespace proofmass::wire::test {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

inline DecodeError refusal_of(const std::string& bytes) {
  const auto decoded = decode(bytes);
  const auto* const error = std::get_if<DecodeError>(&decoded);
  return error != nullptr ? *error : DecodeError{DecodeFault::invalid, "accepted"};
}

/// Why the envelope is refused after the change.
inline std::string refusal(proto::Envelope good,
                           const std::function<void(proto::Envelope&)>& change) {
  good.set_session(1);
  EXPECT_TRUE(std::holds_alternative<proto::Envelope>(decode(encode(good))));
  change(good);
  const DecodeError error = refusal_of(encode(std::move(good)));
  EXPECT_EQ(error.fault, DecodeFault::invalid);
  return error.text;
}

/// Why the message is refused after the change.
template <typename Content>
std::string refusal(const Content& good,
                    const std::type_identity_t<std::function<void(Content&)>>& change) {
  return refusal(proofmass::test::in_envelope(good), [&](proto::Envelope& envelope) {
    Content changed = good;
    change(changed);
    const std::uint64_t session = envelope.session();
    envelope = proofmass::test::in_envelope(changed);
    envelope.set_session(session);
  });
}

}  // namespace proofmass::wire::test
