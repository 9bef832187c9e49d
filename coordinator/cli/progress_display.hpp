#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "coordinator/table/table.hpp"
#include "proto/client.pb.h"

namespace proofmass::coordinator {

enum class DisplayMode : std::uint8_t {
  bar,    ///< One line, written again and again: for a terminal.
  lines,  ///< A line every ten percent, and when storing begins to fail or works again.
  quiet,  ///< Notes only.
};

/// The progress towards so many runs: the most that a campaign with a stop rule may take, which
/// asks for more at each check, so that it never goes back; or those of a part of a campaign.
/// @param num_done_beside  Runs that were done already and are not of the part.
[[nodiscard]] proto::CampaignStatus out_of(proto::CampaignStatus status, std::uint64_t num_runs,
                                           std::uint64_t num_done_beside = 0);

/// A line of at most `columns_max` columns: runs done, percent, rate, time left; or that nothing
/// can be stored. Before the first run is done, how many the workers have.
[[nodiscard]] std::string progress_bar(const proto::CampaignStatus& status,
                                       std::size_t columns_max);

/// The text of progress_bar() without the bar.
[[nodiscard]] std::string progress_line(const proto::CampaignStatus& status);

/// Shows a campaign's progress and notes beside it.
class ProgressDisplay {
 public:
  /// @param stream  Must outlive this object; standard error.
  ProgressDisplay(DisplayMode mode, std::FILE* stream);
  ~ProgressDisplay();  ///< Ends the bar's line.
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  /// May be called as often as one likes.
  void update(const proto::CampaignStatus& status);
  /// A line of its own that stays.
  void note(std::string_view text, Tone tone = Tone::plain);

 private:
  void show_bar(const proto::CampaignStatus& status);

  DisplayMode mode_;
  std::FILE* stream_;
  bool has_bar_ = false;
  std::string shown_;  ///< The bar, or what the last line was about.
};

/// `bar` if the stream takes_escapes(), `lines` otherwise.
[[nodiscard]] DisplayMode display_mode_for(std::FILE* stream);

}  // namespace proofmass::coordinator
