#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass::worker {

/// Who asks a worker to end, and by which signals.
enum class SignalSource : std::uint8_t {
  anyone,      ///< end_signals(): the first drains, the second ends at once.
  supervisor,  ///< handed_on_signal(), with how often; end_signals() drain, as they may come in
               ///< addition.
  campaign,    ///< SIGTERM ends at once; others are ignored: the campaign deals with them.
};

/// What signals have asked for so far.
enum class EndRequest : std::uint8_t { none, drain, abandon };

/// Receives signals by a file descriptor, so that one poll waits for them and for a socket. (The
/// coordinator and the commands use handlers instead: some of their threads never poll.)
class StopSignals {
 public:
  /// Blocks the signals, for good, for the calling thread and those that it makes from now on.
  /// @throws Error if the system has no descriptor left.
  explicit StopSignals(SignalSource source);

  /// Readable while request() has something to take in.
  [[nodiscard]] int descriptor() const { return descriptor_.number(); }

  /// Takes in the signals that have come and returns the strongest request since the beginning.
  [[nodiscard]] EndRequest request();

 private:
  SignalSource source_;
  wire::Descriptor descriptor_;
  EndRequest request_ = EndRequest::none;
};

/// Whom a worker serves, and how.
struct ServeConfig {
  std::string endpoint;  ///< wire::check_endpoint() holds.
  wire::ClientSecurity security;
  wire::SessionId session;  ///< Random, not 0.
  proto::Hello hello;
  ConversationConfig conversation;
  SignalSource signals = SignalSource::anyone;
  std::optional<std::filesystem::path> spool;   ///< Where results survive this process.
  std::function<void()> on_registered = [] {};  ///< Called once a coordinator knows the session.
  wire::Log log = [](const wire::Event&) {};    ///< Told of all that happens.
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
