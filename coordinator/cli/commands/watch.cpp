#include "coordinator/cli/commands/watch.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "coordinator/cli/client_tables.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/watch_display.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void fail_unknown(const wire::StatusReply& status, const std::string& name) {
  std::string names;
  for (const wire::CampaignStatus& campaign : status.campaigns) {
    names += (names.empty() ? "" : ", ") + campaign.name;
  }
  throw Error(fmt::format("campaign = {} (there is {})", name, names.empty() ? "none" : names));
}

void keep_only(wire::StatusReply& status, const std::string& name) {
  const auto is_other = [&](const auto& campaign) { return campaign.name != name; };
  if (std::ranges::all_of(status.campaigns, is_other)) fail_unknown(status, name);
  std::erase_if(status.campaigns, is_other);
}

WatchMode mode_for(OutputFormat format) {
  if (format == OutputFormat::json) return WatchMode::json;
  return isatty(fileno(stdout)) != 0 ? WatchMode::screen : WatchMode::lines;
}

}  // namespace

int watch_until_over(const Ask& ask, const std::optional<std::string>& campaign,
                     WatchDisplay& display, const std::function<void()>& pause) {
  for (;;) {
    wire::StatusReply status = whole_status(ask);
    if (campaign) keep_only(status, *campaign);
    display.update(status);
    if (std::ranges::all_of(status.campaigns, is_over)) {
      const bool was_cancelled = std::ranges::any_of(status.campaigns, [](const auto& one) {
        return one.phase == wire::CampaignPhase::cancelled;
      });
      return was_cancelled ? exit_cannot_be_done : exit_done;
    }
    pause();
  }
}

namespace {

struct WatchOptions {
  ClientOptions client;
  std::optional<std::string> campaign;  ///< By default all.
};

int watch_campaigns(const WatchOptions& options) {
  if (options.campaign) (void)checked_campaign_name(*options.campaign);
  WatchDisplay display(mode_for(options.client.format), stdout);
  return with_connection(options.client, [&](const Ask& ask) {
    return watch_until_over(ask, options.campaign, display,
                            [] { std::this_thread::sleep_for(std::chrono::seconds(1)); });
  });
}

}  // namespace

void add_watch(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<WatchOptions>(
      app, chosen, "watch", "Show where campaigns stand until they are finished", watch_campaigns);
  command.add_option("NAME", options.campaign, "Campaign; all by default");
  add_client_options(command, options.client);
}

}  // namespace proofmass::coordinator
