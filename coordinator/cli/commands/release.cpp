#include <fmt/format.h>

#include <string>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

struct ReleaseOptions {
  ClientOptions client;
  std::string host;
};

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

}  // namespace

void add_release(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReleaseOptions>(
      app, chosen, "release", "Lend runs to a host in quarantine again", release_host);
  command.add_option("HOST", options.host, "Host, as `proofmass workers` names it")->required();
  add_client_options(command, options.client);
}

}  // namespace proofmass::coordinator
