#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/commands/watch.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/text/visible_text.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

/// Arguments of `proofmass submit`.
struct SubmitOptions {
  ClientOptions client;
  std::filesystem::path campaign_file;
  Overrides overrides;
  std::optional<std::string> name;       ///< By default the one in the file.
  std::optional<int> priority;           ///< -100 to 100; as it is without one.
  std::optional<double> audit_fraction;  ///< 0 to 1; as it is without one.
  StopPlan stop;
  bool waits = false;
};

/// The campaign that the arguments name.
std::unique_ptr<Campaign> campaign_to_submit(const SubmitOptions& options) {
  std::unique_ptr<Campaign> campaign = read_campaign(options.campaign_file, options.overrides);
  check_until(*campaign, options.stop.stop_rule);
  if (options.name) {
    campaign->name = *options.name;
    check_campaign_name(campaign->name, NameOrigin::given);
  }
  return campaign;
}

proto::RequestEnvelope submit_request(const SubmitOptions& options, const Campaign& campaign) {
  proto::RequestEnvelope request;
  proto::SubmitRequest& submit = *request.mutable_submit();
  wire::set_definition(campaign.definition(TableColumns::included), submit);
  const Model& model = campaign.model();
  if (!model.description().empty()) {
    say_reference_runs(model);
    wire::require_repeatable(model);
    submit.set_model_description(std::string(model.description()));
    submit.set_reference_digest(model.reference_digest(best_instruction_set()));
  }
  if (options.priority) submit.set_priority(*options.priority);
  if (options.audit_fraction) submit.set_audit_fraction(*options.audit_fraction);
  submit.set_stop_rule(options.stop.stop_rule);
  if (options.stop.failures_max) submit.set_failures_max(*options.stop.failures_max);
  return request;
}

/// A campaign that was cancelled because of its failures says so, as `run` does.
void say_failures(const Ask& ask, const std::string& name, std::uint64_t failures_max) {
  const proto::StatusReply status = whole_status(ask);
  const auto found = std::ranges::find(status.campaigns(), name, &proto::CampaignStatus::name);
  if (found == status.campaigns().end()) return;
  const std::uint64_t num_failures = found->num_without_estimate() + found->num_given_up();
  const bool is_cancelled = found->phase() == proto::CAMPAIGN_PHASE_CANCELLED;
  if (!is_cancelled || num_failures <= failures_max) return;
  wire::say(too_many_failures_text(num_failures, found->num_runs(), failures_max));
}

// A new campaign, or one that is there and has more runs now.
int submit_campaign(const SubmitOptions& options) {
  const std::unique_ptr<Campaign> campaign = campaign_to_submit(options);
  const proto::RequestEnvelope request = submit_request(options, *campaign);
  return with_connection(options.client, [&](const Ask& ask) {
    print_done(ask, request, {.name = "submit", .kind = "campaign", .target = campaign->name},
               options.client.format);
    if (!options.waits) return static_cast<int>(exit_done);
    flush_standard_output();
    const int exit_code = watch_on_standard_output(ask, campaign->name, options.client.format);
    if (options.stop.failures_max) say_failures(ask, campaign->name, *options.stop.failures_max);
    return exit_code;
  });
}

}  // namespace

void add_submit(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<SubmitOptions>(
      app, chosen, "submit", "Hand a campaign or more runs to a coordinator", submit_campaign);
  add_campaign_file(command, options.campaign_file);
  command.add_option("--name", options.name, "Name of the campaign; the one in FILE by default");
  command
      .add_option(
          "--priority", options.priority,
          "Higher priorities come first; by default 0, or\nunchanged if the campaign exists")
      ->check(wire::in_range(-wire::priority_max, wire::priority_max));
  add_audit_option(command, options.audit_fraction);
  add_stop_options(command, options.stop);
  add_override_options(command, options.overrides);
  command.add_flag("--wait", options.waits,
                   "Show the progress until the campaign is\nfinished, as `watch` does");
  add_client_options(command, options.client);
  command.footer(exit_codes_text({exit_not_met}));
}

}  // namespace proofmass::coordinator
