#include "coordinator/cli/command_line.hpp"

#include "coordinator/cli/program.hpp"

namespace proofmass::coordinator {

int run_proofmass(int argc, char** argv,
                  const std::function<void(CLI::App&, Command&)>& add_further_commands) {
  CLI::App app("Proofmass validates the in-flight calibration of drag-free accelerometers.",
               "proofmass");
  app.footer(exit_codes_text);
  app.set_version_flag("--version", "proofmass " PROOFMASS_VERSION);
  app.require_subcommand(1);
  app.set_config("--config", "", "TOML file with options, a section a command")
      ->envname("PROOFMASS_CONFIG");
  app.allow_config_extras(CLI::config_extras_mode::error);
  Command chosen;
  add_local_commands(app, chosen);
  add_further_commands(app, chosen);
  add_analysis_commands(app, chosen);
  add_archive_commands(app, chosen);
  add_client_commands(app, chosen);
  return run_program(app, argc, argv, [&] { return chosen(); });
}

}  // namespace proofmass::coordinator
