#include "coordinator/cli/watch_display.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <utility>

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/client_tables.hpp"
#include "coordinator/report/text_cells.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// Changes when a line about the campaign is worth writing.
std::string gist_of(const wire::CampaignStatus& campaign) {
  const std::uint64_t tenths =
      campaign.num_done * 10 / std::max<std::uint64_t>(1, campaign.num_runs);
  return fmt::format("{} {} {} {} {}", static_cast<int>(campaign.phase), tenths,
                     campaign.num_given_up, campaign.num_mismatches, campaign.storage_failure);
}

}  // namespace

Drawing drawn_over(std::size_t num_lines_before, std::string_view text, ScreenSize size) {
  // The cursor stands below the last line, so one row stays free.
  const std::size_t rows_max = std::max<std::size_t>(2, size.rows) - 1;
  Drawing drawing;
  if (num_lines_before > 0) drawing.text = fmt::format("\033[{}A", num_lines_before);
  while (!text.empty() && drawing.num_lines < rows_max) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    // What a longer line left behind is erased to the end of the line.
    drawing.text += shortened(text.substr(0, end), size.columns) + "\033[K\n";
    text.remove_prefix(std::min(end + 1, text.size()));
    ++drawing.num_lines;
  }
  drawing.text += "\033[J";
  return drawing;
}

ScreenSize screen_size_of(std::FILE* stream) {
  winsize size{};
  const bool is_known = ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  if (!is_known) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

WatchDisplay::WatchDisplay(WatchMode mode, std::FILE* stream) : mode_(mode), stream_(stream) {}

void WatchDisplay::update(const wire::StatusReply& status) {
  switch (mode_) {
    case WatchMode::screen:
      show_screen(status);
      break;
    case WatchMode::lines:
      show_lines(status);
      break;
    case WatchMode::json:
      fmt::print(stream_, "{}", status_json(status, JsonLayout::one_line));
      break;
  }
  std::fflush(stream_);
}

void WatchDisplay::show_screen(const wire::StatusReply& status) {
  const std::string table = wire::visible_lines(status_table(status));
  const Drawing drawing = drawn_over(num_lines_drawn_, table, screen_size_of(stream_));
  fmt::print(stream_, "{}", drawing.text);
  num_lines_drawn_ = drawing.num_lines;
}

void WatchDisplay::show_lines(const wire::StatusReply& status) {
  for (const wire::CampaignStatus& campaign : status.campaigns) {
    std::string gist = gist_of(campaign);
    std::string& shown = shown_[campaign.name];
    if (gist == shown) continue;
    shown = std::move(gist);
    fmt::print(stream_, "{}\n", wire::visible_text(campaign_line(campaign)));
  }
}

}  // namespace proofmass::coordinator
