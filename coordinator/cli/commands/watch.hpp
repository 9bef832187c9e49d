#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/output.hpp"

namespace proofmass::coordinator {

enum class WatchMode : std::uint8_t {
  screen,  ///< The table of `status`, drawn again in its place: for a terminal.
  lines,   ///< A line when a campaign has advanced by ten percent, or something happened.
  json,    ///< An object a line, each time.
};

/// A text and what makes it take the place of the one drawn before.
struct Drawing {
  std::string text;
  std::size_t num_lines = 0;  ///< Of the table that is on the screen.
};

/// Lines ended by `\n`, none longer than the screen, to be drawn over `num_lines_before` lines that
/// end right above the cursor. If there are more lines than the screen has rows, the last one says
/// how many are left out.
[[nodiscard]] Drawing drawn_over(std::size_t num_lines_before, std::string_view text,
                                 std::size_t num_rows);

/// Shows where campaigns stand, again and again.
class WatchDisplay {
 public:
  /// @param stream  Must outlive this object.
  WatchDisplay(WatchMode mode, std::FILE* stream);

  void update(const proto::StatusReply& status);

 private:
  void show_screen(const proto::StatusReply& status);
  void show_lines(const proto::StatusReply& status);

  WatchMode mode_;
  std::FILE* stream_;
  std::size_t num_lines_drawn_ = 0;
  std::map<std::string, std::string> shown_;  ///< By campaign: what the last line was about.
};

/// Asks and shows where the campaign stands, or all do, until they are finished or cancelled.
///
/// @param campaign  By default all.
/// @param pause     Called between one question and the next.
/// @return exit_done, or exit_cannot_be_done if one of them was cancelled or has failed.
/// @throws Error naming the campaigns that there are, if there is no such one; as reply_of() does.
[[nodiscard]] int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                                   WatchDisplay& display, const std::function<void()>& pause);

/// watch_until_over() with a WatchDisplay on standard output, each second.
/// @return Also exit_not_met, if the campaign that is named has missed its stop rule.
[[nodiscard]] int watch_on_standard_output(const Ask& ask,
                                           const std::optional<std::string>& campaign,
                                           OutputFormat format);

}  // namespace proofmass::coordinator
