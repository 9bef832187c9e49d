#include <fmt/format.h>

#include <string>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/report/status_notes.hpp"
#include "core/campaign/name.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

int show_status(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const proto::StatusReply status = whole_status(ask);
    if (options.format == OutputFormat::json) {
      print_json(status_json(status));
    } else {
      TerminalStyle style = style_of(stdout);
      style.wraps_cells = true;
      write_standard_output(status_text(status, style));
    }
    return exit_done;
  });
}

int show_workers(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const proto::WorkersReply workers = all_workers(ask);
    if (options.format == OutputFormat::json) {
      print_json(workers_json(workers));
    } else {
      write_standard_output(terminal_text(workers_table(workers), style_of(stdout)));
    }
    return exit_done;
  });
}

}  // namespace

void add_status(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ClientOptions>(
      app, chosen, "status", "Show the progress of a coordinator's campaigns", show_status);
  add_client_options(command, options);
}

void add_workers(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ClientOptions>(
      app, chosen, "workers", "Show the workers of a coordinator", show_workers);
  add_client_options(command, options);
}

namespace {

using proto::ControlAction;

struct ControlOptions {
  ClientOptions client;
  ControlAction action = proto::CONTROL_ACTION_PAUSE;
  std::string campaign;
  int priority = 0;  ///< For set_priority.
};

int ask_for(const ClientOptions& client, const proto::RequestEnvelope& request,
            const ActionTaken& action) {
  return with_connection(client, [&](const Ask& ask) {
    print_done(ask, request, action, client.format);
    return exit_done;
  });
}

int control_campaign(const ControlOptions& options) {
  proto::RequestEnvelope request;
  proto::ControlRequest& control = *request.mutable_control();
  control.set_action(options.action);
  control.set_campaign(checked_campaign_name(options.campaign));
  control.set_priority(options.priority);
  return ask_for(
      options.client, request,
      {.name = wire::name_of(options.action), .kind = "campaign", .target = options.campaign});
}

void add_action(CLI::App& app, Command& chosen, ControlAction action,
                const std::string& description) {
  auto [command, options] = add_command<ControlOptions>(
      app, chosen, std::string(wire::name_of(action)), description, control_campaign);
  options.action = action;
  command.add_option("NAME", options.campaign, "Campaign")->required();
  if (action == proto::CONTROL_ACTION_SET_PRIORITY) {
    command.add_option("PRIORITY", options.priority, "-100 to 100; higher ones are computed first")
        ->check(wire::in_range(-wire::priority_max, wire::priority_max))
        ->required();
  }
  add_client_options(command, options.client);
}

struct ReleaseOptions {
  ClientOptions client;
  std::string host;
};

int release_host(const ReleaseOptions& options) {
  if (!wire::is_name(options.host)) {
    throw UsageError(fmt::format("host = \"{}\" ({})", options.host, is_name_rule));
  }
  proto::RequestEnvelope request;
  request.mutable_release_host()->set_host(options.host);
  return ask_for(options.client, request,
                 {.name = "release", .kind = "host", .target = options.host});
}

}  // namespace

void add_control(CLI::App& app, Command& chosen) {
  add_action(app, chosen, proto::CONTROL_ACTION_PAUSE,
             "Lend no more runs of a campaign until `resume`");
  add_action(app, chosen, proto::CONTROL_ACTION_RESUME, "Continue a paused or cancelled campaign");
  add_action(app, chosen, proto::CONTROL_ACTION_CANCEL,
             "Drop a campaign's open runs; results stay");
  add_action(app, chosen, proto::CONTROL_ACTION_SET_PRIORITY,
             "Compute a campaign earlier or later");
  add_action(app, chosen, proto::CONTROL_ACTION_RETRY,
             "Compute the given-up runs of a campaign again");
  add_action(app, chosen, proto::CONTROL_ACTION_ARCHIVE,
             "Serve a finished or cancelled campaign no longer");
}

void add_release(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReleaseOptions>(
      app, chosen, "release", "Lend runs to a host in quarantine again", release_host);
  command.add_option("HOST", options.host, "Host, as `proofmass workers` names it")->required();
  add_client_options(command, options.client);
}

}  // namespace proofmass::coordinator
