#pragma once

#include <string>

namespace proofmass::wire {

/// The name of this machine, with `-` for what is_name() does not allow.
[[nodiscard]] std::string host_name();

}  // namespace proofmass::wire
