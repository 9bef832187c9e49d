#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"
#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"
#include "worker/net/conversation.hpp"
#include "worker/net/stop_signals.hpp"

namespace proofmass::worker {

/// Whom a worker serves, and how.
struct ServeConfig {
  std::string endpoint;  ///< wire::check_endpoint() holds.
  wire::ClientSecurity security;
  wire::SessionId session;  ///< Random, not 0.
  proto::Hello hello;
  ConversationConfig conversation;
  SignalSource signals = SignalSource::anyone;
  std::optional<std::filesystem::path> spool;  ///< Where results survive this process.
  wire::Log log = [](const wire::Event&) {};   ///< Told of all that happens.
};

/// Computes runs for the coordinator at the endpoint until told to stop. To be called by the thread
/// that made all others, with the signals blocked: StopSignals of the same source exists.
///
/// @param execution  Its runs may still be computed when the function returns.
/// @param progress   Notified by the execution when it has something new.
/// @throws Error if the socket cannot be made, or the spool not be used.
[[nodiscard]] Ending serve(const ServeConfig& config, Execution& execution,
                           const wire::Wake& progress, StopSignals& signals);

}  // namespace proofmass::worker
