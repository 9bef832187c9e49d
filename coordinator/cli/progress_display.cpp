#include "coordinator/cli/progress_display.hpp"

#include <fmt/format.h>

#include <cstddef>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/status_notes.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

std::string figures(const proto::CampaignStatus& status) {
  if (!status.storage_failure().empty()) {
    return fmt::format("{:3} %  nothing can be stored", percent_done(status));
  }
  if (status.num_done() == 0 && status.num_lent() > 0) {
    return fmt::format("{:3} %  computing the first {}", percent_done(status), status.num_lent());
  }
  std::string text = fmt::format("{:3} %", percent_done(status));
  if (status.rate_hz() > 0.0) text += fmt::format("  {} runs/s", rate_text(status));
  if (status.has_remaining_s() && status.num_done() < status.num_runs()) {
    text += fmt::format("  {} left", time_left_text(status));
  }
  return text;
}

}  // namespace

proto::CampaignStatus out_of(proto::CampaignStatus status, std::uint64_t num_runs,
                             std::uint64_t num_done_beside) {
  status.set_num_runs(num_runs);
  status.set_num_done(status.num_done() - num_done_beside);
  if (status.rate_hz() > 0.0) {
    status.set_remaining_s(static_cast<double>(num_runs - status.num_done()) / status.rate_hz());
  }
  return status;
}

std::string progress_bar(const proto::CampaignStatus& status, std::size_t columns_max) {
  const std::string left = fmt::format("{}/{} runs [", status.num_done(), status.num_runs());
  const std::string right = fmt::format("] {}", figures(status));
  const std::size_t used = left.size() + right.size();
  const std::size_t width = columns_max > used ? columns_max - used : 1;
  const std::size_t filled = width * percent_done(status) / 100;
  const std::string line =
      left + std::string(filled, '#') + std::string(width - filled, '.') + right;
  return line.substr(0, columns_max);
}

std::string progress_line(const proto::CampaignStatus& status) {
  return fmt::format("{}/{} runs  {}", status.num_done(), status.num_runs(), figures(status));
}

DisplayMode display_mode_for(std::FILE* stream) {
  return takes_escapes(stream) ? DisplayMode::bar : DisplayMode::lines;
}

ProgressDisplay::ProgressDisplay(DisplayMode mode, std::FILE* stream)
    : mode_(mode), stream_(stream) {}

ProgressDisplay::~ProgressDisplay() {
  if (has_bar_) wire::say_on(stream_, "\n");
}

void ProgressDisplay::update(const proto::CampaignStatus& status) {
  if (mode_ == DisplayMode::bar) return show_bar(status);
  if (mode_ == DisplayMode::quiet) return;
  std::string gist =
      fmt::format("{} {}", percent_done(status) / 10, status.storage_failure().empty());
  if (gist == shown_) return;
  shown_ = std::move(gist);
  wire::say_on(stream_, progress_line(status) + "\n");
}

void ProgressDisplay::show_bar(const proto::CampaignStatus& status) {
  std::string line = progress_bar(status, screen_size_of(stream_).columns - 1);
  if (has_bar_ && line == shown_) return;
  // The longer line before it is wiped by the erasure to the end of the line.
  wire::say_on(stream_, fmt::format("\r{}\033[K", line));
  std::fflush(stream_);
  has_bar_ = true;
  shown_ = std::move(line);
}

void ProgressDisplay::note(std::string_view text, Tone tone) {
  if (has_bar_) wire::say_on(stream_, "\r\033[K");
  wire::say_on(stream_, in_tone(wire::visible_lines(text), tone, style_of(stream_).paint) + "\n");
  has_bar_ = false;
}

}  // namespace proofmass::coordinator
