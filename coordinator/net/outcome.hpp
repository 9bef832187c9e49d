#pragma once

#include <exception>
#include <functional>

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

}  // namespace proofmass::coordinator
