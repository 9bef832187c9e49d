#include "coordinator/cli/client.hpp"
#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/client_tables.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"

namespace proofmass::coordinator {
namespace {

int show_status(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const wire::StatusReply status = whole_status(ask);
    print_lines(options.format == OutputFormat::json
                    ? status_json(status, JsonLayout::indented)
                    : status_table(status, line_width_max_of(stdout)));
    return exit_done;
  });
}

}  // namespace

void add_status(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ClientOptions>(
      app, chosen, "status", "Show where the campaigns of a coordinator stand", show_status);
  add_client_options(command, options);
}

}  // namespace proofmass::coordinator
