#pragma once

#include <string>
#include <string_view>

namespace proofmass::wire {

/// Accepts the addresses at which coordinator and worker may meet: `ipc://PATH`,
/// `tcp://127.0.0.1:PORT` and `tcp://[::1]:PORT`. What they say is not encrypted, so nothing that
/// another machine could reach is accepted.
///
/// @param option  Name of the command-line option that the endpoint comes from, for the message.
/// @throws InvalidArgument reading `option = endpoint (rule)`.
void check_endpoint(std::string_view option, const std::string& endpoint);

}  // namespace proofmass::wire
