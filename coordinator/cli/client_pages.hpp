#pragma once

#include "coordinator/cli/client_options.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

// What a coordinator tells in several replies, if it is too much for one.

/// All campaigns.
/// @throws Error if the coordinator refuses.
[[nodiscard]] wire::StatusReply whole_status(const Ask& ask);

/// All workers.
/// @throws Error if the coordinator refuses.
[[nodiscard]] wire::WorkersReply all_workers(const Ask& ask);

}  // namespace proofmass::coordinator
