#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "coordinator/cli/command_line.hpp"
#include "coordinator/cli/init_command.hpp"
#include "coordinator/cli/keygen_command.hpp"
#include "coordinator/cli/override_options.hpp"
#include "coordinator/cli/run_command.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

constexpr unsigned workers_max = 1024;

// Each command shares its options with the callback that CLI11 keeps and with the chosen command.

void add_run(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<RunOptions>();
  CLI::App& run = *app.add_subcommand("run", "Run a campaign, or what is missing of it");
  run.add_option("FILE", options->campaign_file, "Campaign file (TOML)")->required();
  run.add_option("--db", options->database, "Database; FILE's stem with .db, here, by default");
  add_override_options(run, options->overrides);
  add_audit_option(run, options->audit_fraction);
  add_stop_options(run, options->stop);
  run.add_option("--workers", options->num_workers, "Worker processes; one a processor by default")
      ->check(wire::in_range(1U, workers_max));
  run.add_flag("--quiet", options->is_quiet, "Show no progress");
  run.callback([options, &chosen] { chosen = [options] { return run_campaign(*options); }; });
}

void add_init(CLI::App& app, Command& chosen) {
  struct InitOptions {
    std::filesystem::path file = "hardy2013.toml";
    bool is_forced = false;
  };
  const auto options = std::make_shared<InitOptions>();
  CLI::App& init = *app.add_subcommand("init", "Write the paper's campaign file, commented");
  init.add_option("FILE", options->file, "File to write")->capture_default_str();
  init.add_flag("--force", options->is_forced, "Replace an existing file");
  init.callback([options, &chosen] {
    chosen = [options] {
      return write_campaign(options->file,
                            options->is_forced ? IfFileExists::replace : IfFileExists::refuse);
    };
  });
}

void add_keygen(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<KeygenOptions>();
  CLI::App& keygen = *app.add_subcommand("keygen", "Make keys of a coordinator, workers, clients");
  keygen.add_option("DIRECTORY", options->directory, "Directory to make, or to add a key to")
      ->required();
  keygen.add_option("--worker", options->worker, "Add a key of this name for a worker");
  keygen.add_option("--client", options->client, "Add a key of this name for a client");
  keygen.callback([options, &chosen] { chosen = [options] { return make_keys(*options); }; });
}

}  // namespace

void add_local_commands(CLI::App& app, Command& chosen) {
  add_run(app, chosen);
  add_init(app, chosen);
  add_keygen(app, chosen);
}

}  // namespace proofmass::coordinator
