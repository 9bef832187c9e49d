#include "coordinator/cli/submit_command.hpp"

#include "coordinator/cli/client_json.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

std::unique_ptr<Campaign> campaign_to_submit(const SubmitOptions& options) {
  std::unique_ptr<Campaign> campaign = read_campaign(options.campaign_file, options.overrides);
  if (options.name) {
    campaign->name = *options.name;
    try {
      campaign->validate();
    } catch (const ConfigError& error) {
      throw UsageError(error.what());
    }
  }
  return campaign;
}

wire::SubmitRequest submit_request(const SubmitOptions& options, const Campaign& campaign) {
  return {.definition = campaign.definition(TableColumns::included),
          .priority = options.priority,
          .audit_fraction = options.audit_fraction,
          .stop_rule = options.stop.rule,
          .failures_max = options.stop.failures_max};
}

int submit_campaign(const SubmitOptions& options) {
  const std::unique_ptr<Campaign> campaign = campaign_to_submit(options);
  const wire::SubmitRequest request = submit_request(options, *campaign);
  return with_connection(options.client, [&](const Ask& ask) {
    const auto done = reply_of<wire::DoneReply>(ask, request);
    const bool is_json = options.client.format == OutputFormat::json;
    print_lines(is_json ? done_json("submit", campaign->name, done) : done.text + "\n");
    return exit_done;
  });
}

}  // namespace proofmass::coordinator
