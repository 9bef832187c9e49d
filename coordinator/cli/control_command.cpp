#include "coordinator/cli/control_command.hpp"

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

int control_campaign(const ControlOptions& options) {
  const wire::ControlRequest request{.action = options.action,
                                     .campaign = checked_campaign_name(options.campaign)};
  return with_connection(options.client, [&](const Ask& ask) {
    const auto done = reply_of<wire::DoneReply>(ask, request);
    const bool is_json = options.client.format == OutputFormat::json;
    print_lines(is_json ? done_json(wire::name_of(request.action), request.campaign, done)
                        : done.text + "\n");
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
