#pragma once

#include <functional>
#include <optional>
#include <string>

#include "coordinator/cli/client.hpp"

namespace proofmass::coordinator {

class WatchDisplay;

/// Asks and shows where the campaign stands, or all do, until they are finished or cancelled.
///
/// @param campaign  By default all.
/// @param pause     Called between one question and the next.
/// @return exit_done, or exit_cannot_be_done if one of them was cancelled.
/// @throws Error naming the campaigns that there are, if there is no such one; as reply_of() does.
[[nodiscard]] int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                                   WatchDisplay& display, const std::function<void()>& pause);

}  // namespace proofmass::coordinator
