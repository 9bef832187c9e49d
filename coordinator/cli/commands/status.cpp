#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"

namespace proofmass::coordinator {
namespace {

int show_status(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const proto::StatusReply status = whole_status(ask);
    if (options.format == OutputFormat::json) {
      print_json(status_json(status));
    } else {
      write_standard_output(status_text(status, style_of(stdout)));
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

}  // namespace proofmass::coordinator
