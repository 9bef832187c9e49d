#pragma once

#include <string>

namespace proofmass::test {

/// What an action throws of that kind, as text; empty if nothing.
template <typename Exception, typename Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const Exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace proofmass::test
