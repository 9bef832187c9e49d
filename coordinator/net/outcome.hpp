#pragma once

#include <exception>
#include <functional>
#include <string>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Answers a request, now or later; called once, in the service's thread.
using Respond = std::function<void(proto::ReplyEnvelope)>;

/// Why an action throws; empty if it does not.
[[nodiscard]] inline std::string failure_of(const std::function<void()>& action) {
  try {
    action();
    return {};
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Lets an action respond; if it throws instead, responds with the reason: a client waits for as
/// long as its request is not answered.
inline void respond_or_say_why(const Respond& respond, const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    respond(wire::error_reply(error.what()));
  }
}

}  // namespace proofmass::coordinator
