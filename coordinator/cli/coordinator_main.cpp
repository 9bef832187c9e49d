#include "coordinator/cli/program.hpp"
#include "coordinator/cli/serve_command.hpp"

int main(int argc, char** argv) {
  using namespace proofmass::coordinator;
  CLI::App app(
      "Lends the runs of a campaign to workers and stores their results.\n"
      "SIGTERM lets workers finish what they hold; SIGINT, or a second signal, does not.");
  app.footer(exit_codes_text);
  app.set_version_flag("--version", "proofmass-coordinator " PROOFMASS_VERSION);
  ServeOptions options;
  app.add_option("FILE", options.campaign_file, "Campaign file (TOML)")->required();
  app.add_option("--db", options.database, "Database; made if it does not exist")->required();
  app.add_option("--bind", options.endpoint,
                 "Where workers connect: ipc://PATH or tcp://127.0.0.1:PORT")
      ->required();
  return run_program(app, argc, argv, [&] { return serve_campaign(options); });
}
