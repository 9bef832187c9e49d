#include "coordinator/cli/status_command.hpp"

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/client_pages.hpp"
#include "coordinator/cli/client_tables.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"

namespace proofmass::coordinator {

int show_status(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const wire::StatusReply status = whole_status(ask);
    print_lines(options.format == OutputFormat::json ? status_json(status, JsonLayout::indented)
                                                     : status_table(status));
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
