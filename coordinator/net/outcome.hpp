#pragma once

#include <exception>
#include <functional>
#include <string>

#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// The reply of an action, or the reason why it throws. What is done for a request in its
/// background part goes through here, because a client waits for as long as its request is not
/// answered.
[[nodiscard]] inline wire::ClientReply outcome_of(
    const std::function<wire::ClientReply()>& action) {
  try {
    return action();
  } catch (const std::exception& error) {
    return wire::ErrorReply{error.what()};
  }
}

/// Why an action throws; empty if it does not.
[[nodiscard]] inline std::string failure_of(const std::function<void()>& action) {
  try {
    action();
    return {};
  } catch (const std::exception& error) {
    return error.what();
  }
}

}  // namespace proofmass::coordinator
