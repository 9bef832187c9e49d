#include "coordinator/cli/workers_command.hpp"

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/client_pages.hpp"
#include "coordinator/cli/client_tables.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"

namespace proofmass::coordinator {

int show_workers(const ClientOptions& options) {
  return with_connection(options, [&](const Ask& ask) {
    const wire::WorkersReply workers = all_workers(ask);
    print_lines(options.format == OutputFormat::json ? workers_json(workers)
                                                     : workers_table(workers));
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
