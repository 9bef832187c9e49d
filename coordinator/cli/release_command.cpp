#include "coordinator/cli/release_command.hpp"

#include <fmt/format.h>

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {

int release_host(const ReleaseOptions& options) {
  if (!wire::is_name(options.host)) {
    throw UsageError(
        fmt::format("host = \"{}\" (must be 1 to 128 of [A-Za-z0-9._-])", options.host));
  }
  return with_connection(options.client, [&](const Ask& ask) {
    const auto done =
        reply_of<wire::DoneReply>(ask, wire::ReleaseHostRequest{.host = options.host});
    const bool is_json = options.client.format == OutputFormat::json;
    print_lines(is_json ? released_json(options.host, done) : done.text + "\n");
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
