#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// The bytes of the reply to what a client sent: what is no request is answered with an ErrorReply,
/// and so is a reply that would be too large.
///
/// @param frames     As they came, anything at all.
/// @param carry_out  Called with a request whose form has been checked.
[[nodiscard]] std::string answer_client(
    std::span<const std::string_view> frames,
    const std::function<wire::ClientReply(const wire::ClientRequest&)>& carry_out);

}  // namespace proofmass::coordinator
