#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "coordinator/cli/bench_command.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/cli/run_command.hpp"
#include "coordinator/cli/small_commands.hpp"

namespace {

using namespace proofmass::coordinator;

constexpr unsigned workers_max = 1024;
constexpr std::uint64_t bench_runs_max = 1'000'000;

CLI::App* add_run(CLI::App& app, RunOptions& options) {
  CLI::App* const run = app.add_subcommand("run", "Run a campaign, or what is missing of it");
  run->add_option("FILE", options.campaign_file, "Campaign file (TOML)")->required();
  run->add_option("--db", options.database, "Database; FILE's stem with .db, here, by default");
  run->add_option("--runs", options.overrides.num_runs, "Number of runs; more than before extends");
  run->add_option("--seed", options.overrides.seed, "Seed of the campaign");
  run->add_option("--workers", options.num_workers, "Worker processes; one a processor by default")
      ->check(CLI::Range(1U, workers_max));
  run->add_option("--set", options.overrides.assignments,
                  "Replace a value of the file, e.g. noise.scale=0; may be repeated")
      ->take_all()
      ->allow_extra_args(false);
  run->add_flag("--quiet", options.is_quiet, "Show no progress");
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Proofmass validates the in-flight calibration of drag-free accelerometers.");
  app.footer(exit_codes_text);
  app.set_version_flag("--version", "proofmass " PROOFMASS_VERSION);
  app.require_subcommand(1);

  RunOptions run_options;
  const CLI::App* const run = add_run(app, run_options);

  std::filesystem::path database;
  CLI::App* const report = app.add_subcommand("report", "Print the tables of a database");
  report->add_option("DB", database, "Database of a campaign")->required();

  std::filesystem::path file = "hardy2013.toml";
  bool is_forced = false;
  CLI::App* const init = app.add_subcommand("init", "Write the paper's campaign file, commented");
  init->add_option("FILE", file, "File to write")->capture_default_str();
  init->add_flag("--force", is_forced, "Replace an existing file");

  BenchOptions bench_options;
  bool is_json = false;
  CLI::App* const bench = app.add_subcommand("bench", "Measure the speed of this machine");
  bench->add_option("--runs", bench_options.num_runs, "Runs of each instruction set")
      ->check(CLI::Range(std::uint64_t{1}, bench_runs_max))
      ->capture_default_str();
  bench->add_flag("--json", is_json, "Print JSON");

  return run_program(app, argc, argv, [&] {
    if (bench->parsed()) {
      bench_options.format = is_json ? BenchFormat::json : BenchFormat::table;
      return run_bench(bench_options);
    }
    if (run->parsed()) return run_campaign(run_options);
    if (report->parsed()) return print_report(database);
    return write_campaign(file, is_forced ? IfFileExists::replace : IfFileExists::refuse);
  });
}
