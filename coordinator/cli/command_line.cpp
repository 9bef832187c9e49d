#include "coordinator/cli/command_line.hpp"

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "proto/command_line/described_program.hpp"
#include "proto/command_line/manual_option.hpp"

namespace proofmass::coordinator {

int run_proofmass(int argc, char** argv,
                  const std::function<void(CLI::App&, Command&)>& add_further_commands) {
  CLI::App app("Validates the in-flight calibration of drag-free accelerometers.", "proofmass");
  app.footer(exit_codes_text({}));  // Of the commands, unless they say otherwise.
  app.set_version_flag("--version", "proofmass " PROOFMASS_VERSION);
  app.require_subcommand(1);
  app.set_config("--config", "", "TOML file with options, a section a command")
      ->envname("PROOFMASS_CONFIG")
      ->type_name(wire::file_type);
  app.allow_config_extras(CLI::config_extras_mode::error);
  Command chosen;
  for (const auto add : {add_run, add_init, add_check, add_keygen}) add(app, chosen);
  add_further_commands(app, chosen);
  for (const auto add : {add_report, add_sensitivity, add_query, add_verify, add_export, add_backup,
                         add_merge, add_compare, add_list, add_tag, add_note, add_submit,
                         add_status, add_watch, add_control, add_workers, add_release}) {
    add(app, chosen);
  }
  app.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  wire::add_manual_option(app, {"proofmass-coordinator", "proofmass-worker"});
  return run_program(app, argc, argv, [&] { return chosen(); });
}

}  // namespace proofmass::coordinator
