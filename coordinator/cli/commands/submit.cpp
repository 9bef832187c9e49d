#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/report/status_notes.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

struct SubmitOptions {
  ClientOptions client;
  std::filesystem::path campaign_file;
  Overrides overrides;
  std::optional<std::string> name;       ///< By default the one in the file.
  std::optional<int> priority;           ///< -100 to 100; as it is without one.
  std::optional<double> audit_fraction;  ///< 0 to 1; as it is without one.
  StopPlan stop;
  bool waits = false;
};

std::unique_ptr<Campaign> campaign_to_submit(const SubmitOptions& options) {
  std::unique_ptr<Campaign> campaign = read_campaign(options.campaign_file, options.overrides);
  check_until(*campaign, options.stop.stop_rule);
  if (options.name) {
    campaign->name = *options.name;
    check_campaign_name(campaign->name, NameOrigin::given);
  }
  return campaign;
}

proto::RequestEnvelope submit_request(const SubmitOptions& options, const Campaign& campaign) {
  proto::RequestEnvelope request;
  proto::SubmitRequest& submit = *request.mutable_submit();
  wire::set_definition(campaign.definition(TableColumns::included), submit);
  const Model& model = campaign.model();
  if (!model.description().empty()) {
    say_reference_runs(model);
    wire::require_repeatable(model);
    submit.set_model_description(std::string(model.description()));
    submit.set_reference_digest(model.reference_digest(best_instruction_set()));
  }
  if (options.priority) submit.set_priority(*options.priority);
  if (options.audit_fraction) submit.set_audit_fraction(*options.audit_fraction);
  submit.set_stop_rule(options.stop.stop_rule);
  if (options.stop.failures_max) submit.set_failures_max(*options.stop.failures_max);
  return request;
}

/// A campaign that was cancelled because of its failures says so, as `run` does.
void say_failures(const Ask& ask, const std::string& name, std::uint64_t failures_max) {
  const proto::StatusReply status = whole_status(ask);
  const auto found = std::ranges::find(status.campaigns(), name, &proto::CampaignStatus::name);
  if (found == status.campaigns().end()) return;
  const std::uint64_t num_failures = found->num_without_estimate() + found->num_given_up();
  const bool is_cancelled = found->phase() == proto::CAMPAIGN_PHASE_CANCELLED;
  if (!is_cancelled || num_failures <= failures_max) return;
  wire::say(too_many_failures_text(num_failures, found->num_runs(), failures_max));
}

// A new campaign, or one that is there and has more runs now.
int submit_campaign(const SubmitOptions& options) {
  const std::unique_ptr<Campaign> campaign = campaign_to_submit(options);
  const proto::RequestEnvelope request = submit_request(options, *campaign);
  const Ask ask = connected(options.client);
  print_done(ask, request, {.name = "submit", .kind = "campaign", .target = campaign->name},
             options.client.format);
  if (!options.waits) return exit_done;
  flush_standard_output();
  const int exit_code = watch_on_standard_output(ask, campaign->name, options.client.format);
  if (options.stop.failures_max) say_failures(ask, campaign->name, *options.stop.failures_max);
  return exit_code;
}

}  // namespace

void add_submit(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<SubmitOptions>(
      app, chosen, "submit", "Hand a campaign or more runs to a coordinator", submit_campaign);
  add_campaign_file(command, options.campaign_file);
  command.add_option("--name", options.name, "Name of the campaign; the one in FILE by default");
  add_number(command, "--priority", options.priority, {-wire::priority_max, wire::priority_max},
             "Higher priorities come first; by default 0, or\nunchanged if the campaign exists");
  add_audit_option(command, options.audit_fraction);
  add_stop_options(command, options.stop);
  add_override_options(command, options.overrides);
  command.add_flag("--wait", options.waits,
                   "Show the progress until the campaign is\nfinished, as `watch` does");
  add_client_options(command, options.client);
  command.footer(exit_codes_text({exit_not_met}));
}

namespace {

/// Changes when a line about the campaign is worth writing.
std::string gist_of(const proto::CampaignStatus& campaign) {
  const std::uint64_t tenths =
      campaign.num_done() * 10 / std::max<std::uint64_t>(1, campaign.num_runs());
  const auto num_troubles = std::ranges::count(notes_about(campaign), Tone::bad, &Remark::tone);
  return fmt::format("{} {} {} {} {}", static_cast<int>(campaign.phase()), tenths,
                     campaign.num_given_up(), num_troubles, campaign.storage_failure());
}

/// Campaigns that are over come last: they are the ones that a small screen leaves out.
proto::StatusReply with_open_ones_first(proto::StatusReply status) {
  std::stable_partition(status.mutable_campaigns()->begin(), status.mutable_campaigns()->end(),
                        [](const auto& campaign) { return !is_over(campaign); });
  return status;
}

/// What fits of a line of terminal_text(). Its escape sequences, which take no room, stay.
std::string cut_line(std::string_view line, std::size_t width) {
  std::string cut;
  while (!line.empty()) {
    const bool is_escape = line.front() == '\033';
    const std::size_t end = is_escape ? line.find('m') + 1 : line.find('\033');
    const std::string_view part = line.substr(0, end);
    line.remove_prefix(part.size());
    if (!is_escape && width == 0) continue;
    cut += is_escape ? std::string(part) : shortened(part, width);
    if (!is_escape) width -= std::min(width, display_width(part));
  }
  return cut;
}

}  // namespace

Drawing drawn_over(std::size_t num_lines_before, std::string_view text, const ScreenSize& screen) {
  // The cursor stands below the last line, so one row stays free.
  const std::size_t rows_max = std::max<std::size_t>(2, screen.rows) - 1;
  const auto num_lines = static_cast<std::size_t>(std::ranges::count(text, '\n')) +
                         (text.empty() || text.ends_with('\n') ? 0 : 1);
  const std::size_t num_shown = num_lines > rows_max ? rows_max - 1 : num_lines;
  Drawing drawing;
  if (num_lines_before > 0) drawing.text = fmt::format("\033[{}A", num_lines_before);
  // A wider line would take two rows. What a longer one left behind is erased.
  const auto draw = [&](std::string_view line) {
    drawing.text.append(cut_line(line, screen.columns - 1)).append("\033[K\n");
    ++drawing.num_lines;
  };
  while (drawing.num_lines < num_shown) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    draw(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  if (num_shown < num_lines) draw(fmt::format("and {} more lines", num_lines - num_shown));
  drawing.text += "\033[J";
  return drawing;
}

WatchDisplay::WatchDisplay(WatchMode mode, std::FILE* stream) : mode_(mode), stream_(stream) {}

void WatchDisplay::update(const proto::StatusReply& status) {
  switch (mode_) {
    case WatchMode::screen:
      show_screen(status);
      break;
    case WatchMode::lines:
      show_lines(status);
      break;
    case WatchMode::json:
      fmt::print(stream_, "{}", dumped(status_json(status), -1));
      break;
  }
  if (std::fflush(stream_) == 0) return;
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

void WatchDisplay::show_screen(const proto::StatusReply& status) {
  TerminalStyle style = style_of(stream_);
  style.cuts_remarks = true;
  const Drawing drawing = drawn_over(
      num_lines_drawn_, status_text(with_open_ones_first(status), style), screen_size_of(stream_));
  fmt::print(stream_, "{}", drawing.text);
  num_lines_drawn_ = drawing.num_lines;
}

void WatchDisplay::show_lines(const proto::StatusReply& status) {
  if (status.campaigns().empty()) fmt::print(stream_, "no campaigns\n");
  for (const proto::CampaignStatus& campaign : status.campaigns()) {
    std::string gist = gist_of(campaign);
    std::string& shown = shown_[campaign.name()];
    if (gist == shown) continue;
    shown = std::move(gist);
    fmt::print(stream_, "{}\n", wire::visible_text(campaign_line(campaign)));
  }
}

namespace {

[[noreturn]] void fail_unknown(const proto::StatusReply& status, const std::string& name) {
  std::string names;
  for (const proto::CampaignStatus& campaign : status.campaigns()) {
    names += (names.empty() ? "" : ", ") + campaign.name();
  }
  throw Error(fmt::format("campaign = {} (there is {})", name, names.empty() ? "none" : names));
}

void keep_only(proto::StatusReply& status, const std::string& name) {
  const auto is_other = [&](const auto& campaign) { return campaign.name() != name; };
  if (std::ranges::all_of(status.campaigns(), is_other)) fail_unknown(status, name);
  auto& campaigns = *status.mutable_campaigns();
  campaigns.erase(std::remove_if(campaigns.begin(), campaigns.end(), is_other), campaigns.end());
}

WatchMode mode_for(OutputFormat format) {
  if (format == OutputFormat::json) return WatchMode::json;
  return takes_escapes(stdout) ? WatchMode::screen : WatchMode::lines;
}

/// As `run` does, says that a finished campaign has missed its stop rule. A coordinator without the
/// program that answers cannot tell.
int exit_code_by_rule(const Ask& ask, const std::string& campaign) {
  proto::RequestEnvelope question = question_about(campaign, proto::QUESTION_REPORT);
  question.mutable_answer()->add_options("--json");
  const proto::ReplyEnvelope reply = ask(question);
  if (!reply.has_answer()) return exit_done;
  const Json report = Json::parse(answer_bytes(ask, reply.answer()), nullptr, false);
  const Json stop = report.is_object() ? report.value("stop", Json()) : Json();
  if (!stop.is_object() || !stop.value("is_missed", false)) return exit_done;
  const Json answer = stop.value("answer", Json());
  wire::say(fmt::format("{}: {}: {}\n", campaign, stop.value("rule", ""),
                        answer.is_string() ? answer.get<std::string>() : "not checked"));
  return exit_not_met;
}

}  // namespace

int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                     WatchDisplay& display, const std::function<void()>& pause) {
  for (;;) {
    proto::StatusReply status = whole_status(ask);
    if (campaign) keep_only(status, *campaign);
    display.update(status);
    if (std::ranges::all_of(status.campaigns(), is_over)) {
      const bool is_in_vain = std::ranges::any_of(status.campaigns(), [](const auto& one) {
        return one.phase() == proto::CAMPAIGN_PHASE_CANCELLED || wire::has_failed(one);
      });
      return is_in_vain ? exit_cannot_be_done : exit_done;
    }
    pause();
  }
}

int watch_on_standard_output(const Ask& ask, const std::optional<std::string>& campaign,
                             OutputFormat format) {
  WatchDisplay display(mode_for(format), stdout);
  const int exit_code = watch_until_over(
      ask, campaign, display, [] { std::this_thread::sleep_for(std::chrono::seconds(1)); });
  return campaign && exit_code == exit_done ? exit_code_by_rule(ask, *campaign) : exit_code;
}

namespace {

struct WatchOptions {
  ClientOptions client;
  std::optional<std::string> campaign;  ///< By default all.
};

int watch_campaigns(const WatchOptions& options) {
  if (options.campaign) (void)checked_campaign_name(*options.campaign);
  return watch_on_standard_output(connected(options.client), options.campaign,
                                  options.client.format);
}

}  // namespace

void add_watch(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<WatchOptions>(
      app, chosen, "watch", "Show the progress until campaigns are finished", watch_campaigns);
  command.add_option("NAME", options.campaign, "Campaign; all by default");
  add_client_options(command, options.client);
  command.footer(exit_codes_text({exit_not_met}));
}

}  // namespace proofmass::coordinator
