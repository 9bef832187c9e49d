#pragma once

#include <functional>
#include <optional>
#include <string>

#include "coordinator/cli/client_options.hpp"

namespace proofmass::coordinator {

class WatchDisplay;

/// Arguments of `proofmass watch`.
struct WatchOptions {
  ClientOptions client;
  std::optional<std::string> campaign;  ///< By default all.
};

/// Asks and shows where the campaign stands, or all do, until they are finished or cancelled.
///
/// @param campaign  By default all.
/// @param pause     Called between one question and the next.
/// @return exit_done, or exit_cannot_be_done if one of them was cancelled.
/// @throws Error naming the campaigns that there are, if there is no such one; as reply_of() does.
[[nodiscard]] int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                                   WatchDisplay& display, const std::function<void()>& pause);

/// The same on standard output, once a second.
/// @return An ExitCode.
/// @throws As watch_until_over() and ClientConnection do; UsageError if no campaign has such a
/// name.
[[nodiscard]] int watch_campaigns(const WatchOptions& options);

}  // namespace proofmass::coordinator
