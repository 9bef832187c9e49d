#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "coordinator/cli/client_options.hpp"
#include "coordinator/cli/command_line.hpp"
#include "coordinator/cli/control_command.hpp"
#include "coordinator/cli/override_options.hpp"
#include "coordinator/cli/release_command.hpp"
#include "coordinator/cli/status_command.hpp"
#include "coordinator/cli/submit_command.hpp"
#include "coordinator/cli/watch_command.hpp"
#include "coordinator/cli/workers_command.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

// Each command shares its options with the callback that CLI11 keeps and with the chosen command.

void add_submit(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<SubmitOptions>();
  CLI::App& submit = *app.add_subcommand("submit", "Hand a campaign or more runs to a coordinator");
  submit.add_option("FILE", options->campaign_file, "Campaign file (TOML)")->required();
  submit.add_option("--name", options->name, "Name of the campaign; the one in FILE by default");
  submit.add_option("--priority", options->priority, "Runs of a higher one are computed first")
      ->check(wire::in_range(-wire::priority_max, wire::priority_max));
  add_audit_option(submit, options->audit_fraction);
  add_stop_options(submit, options->stop);
  add_override_options(submit, options->overrides);
  add_client_options(submit, options->client);
  submit.callback([options, &chosen] { chosen = [options] { return submit_campaign(*options); }; });
}

void add_question(CLI::App& app, Command& chosen, const std::string& name,
                  const std::string& description, int (*answer)(const ClientOptions&)) {
  const auto options = std::make_shared<ClientOptions>();
  CLI::App& question = *app.add_subcommand(name, description);
  add_client_options(question, *options);
  question.callback(
      [options, answer, &chosen] { chosen = [options, answer] { return answer(*options); }; });
}

void add_watch(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<WatchOptions>();
  CLI::App& watch =
      *app.add_subcommand("watch", "Show where campaigns stand until they are finished");
  watch.add_option("NAME", options->campaign, "Campaign; all by default");
  add_client_options(watch, options->client);
  watch.callback([options, &chosen] { chosen = [options] { return watch_campaigns(*options); }; });
}

void add_control(CLI::App& app, Command& chosen, wire::ControlAction action,
                 const std::string& description) {
  const auto options = std::make_shared<ControlOptions>();
  options->action = action;
  CLI::App& control = *app.add_subcommand(std::string(wire::name_of(action)), description);
  control.add_option("NAME", options->campaign, "Campaign")->required();
  add_client_options(control, options->client);
  control.callback(
      [options, &chosen] { chosen = [options] { return control_campaign(*options); }; });
}

void add_release(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<ReleaseOptions>();
  CLI::App& release = *app.add_subcommand("release", "Lend runs to a host in quarantine again");
  release.add_option("HOST", options->host, "Host, as `proofmass workers` names it")->required();
  add_client_options(release, options->client);
  release.callback([options, &chosen] { chosen = [options] { return release_host(*options); }; });
}

}  // namespace

void add_client_commands(CLI::App& app, Command& chosen) {
  using wire::ControlAction;
  add_submit(app, chosen);
  add_question(app, chosen, "status", "Show where the campaigns of a coordinator stand",
               show_status);
  add_watch(app, chosen);
  add_control(app, chosen, ControlAction::pause, "Lend no more runs of a campaign for now");
  add_control(app, chosen, ControlAction::resume, "Go on with a paused or cancelled campaign");
  add_control(app, chosen, ControlAction::cancel, "Drop a campaign's open runs; results stay");
  add_question(app, chosen, "workers", "Show the workers of a coordinator", show_workers);
  add_release(app, chosen);
}

}  // namespace proofmass::coordinator
