#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/page/page.hpp"
#include "coordinator/store/records.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// A command that is being declared, and what its arguments are written to.
template <typename Options>
struct Declared {
  CLI::App& command;
  Options& options;  ///< Lives as long as `command`.
};

/// Declares a command that calls `run` with its options.
/// @param chosen  Set while the arguments are parsed; outlives `app`.
template <typename Options>
Declared<Options> add_command(CLI::App& app, Command& chosen, const std::string& name,
                              const std::string& description,
                              const std::function<int(const Options&)>& run) {
  const auto options = std::make_shared<Options>();
  CLI::App& command = *app.add_subcommand(name, description);
  command.callback([options, run, &chosen] { chosen = [options, run] { return run(*options); }; });
  return {command, *options};
}

/// The same for a command that SIGINT and SIGTERM end in order, see run_until_stopped().
template <typename Options>
Declared<Options> add_stoppable_command(CLI::App& app, Command& chosen, const std::string& name,
                                        const std::string& description,
                                        int (*run)(const Options&, const IsStopped&)) {
  const auto work = [run](const Options& options) {
    return run_until_stopped([&](const IsStopped& is_stopped) { return run(options, is_stopped); });
  };
  const auto declared = add_command<Options>(app, chosen, name, description, work);
  declared.command.footer(exit_codes_text({exit_interrupted}));
  return declared;
}

/// Declares --json.
/// @param format  Lives as long as the command.
inline void add_json_flag(CLI::App& command, OutputFormat& format) {
  command.add_flag_callback(
      "--json", [&format] { format = OutputFormat::json; }, "Print JSON");
}

/// Declares --force.
/// @param if_there  Lives as long as the command.
inline void add_force_flag(CLI::App& command, wire::IfThere& if_there) {
  command.add_flag_callback(
      "--force", [&if_there] { if_there = wire::IfThere::replace; }, "Replace an existing file");
}

/// Type names of campaign databases and campaign files, see wire::file_type.
inline constexpr const char* database_type = "FILE.db";
inline constexpr const char* campaign_file_type = "FILE.toml";

/// Declares an argument that names a campaign database.
inline void add_database(CLI::App& command, std::filesystem::path& database,
                         const std::string& name = "DB") {
  command.add_option(name, database, "Database of a campaign")
      ->type_name(database_type)
      ->required();
}

/// Declares the argument FILE, a campaign file.
inline void add_campaign_file(CLI::App& command, std::filesystem::path& file) {
  command.add_option("FILE", file, "Campaign file (TOML)")
      ->type_name(campaign_file_type)
      ->required();
}

// Each of these functions declares the command of its name, see add_command(). What a command
// throws becomes an exit code in run_program().

void add_run(CLI::App& app, Command& chosen);
void add_sweep(CLI::App& app, Command& chosen);
void add_init(CLI::App& app, Command& chosen);
void add_check(CLI::App& app, Command& chosen);
void add_plan(CLI::App& app, Command& chosen);
void add_environment(CLI::App& app, Command& chosen);
void add_models(CLI::App& app, Command& chosen);
void add_keygen(CLI::App& app, Command& chosen);

// Commands that read or change a database.
void add_report(CLI::App& app, Command& chosen);
void add_plot(CLI::App& app, Command& chosen);
void add_sensitivity(CLI::App& app, Command& chosen);
void add_query(CLI::App& app, Command& chosen);
void add_verify(CLI::App& app, Command& chosen);
void add_export(CLI::App& app, Command& chosen);
void add_replay(CLI::App& app, Command& chosen);
void add_backup(CLI::App& app, Command& chosen);
void add_compare(CLI::App& app, Command& chosen);
void add_import(CLI::App& app, Command& chosen);
void add_merge(CLI::App& app, Command& chosen);
void add_publish(CLI::App& app, Command& chosen);
void add_list(CLI::App& app, Command& chosen);

// Commands that ask a coordinator.
void add_submit(CLI::App& app, Command& chosen);
void add_status(CLI::App& app, Command& chosen);
void add_watch(CLI::App& app, Command& chosen);
void add_control(CLI::App& app, Command& chosen);  ///< `pause`, `resume`, `cancel` and so on.
void add_workers(CLI::App& app, Command& chosen);
void add_release(CLI::App& app, Command& chosen);
void add_factory(CLI::App& app, Command& chosen);
void add_fetch(CLI::App& app, Command& chosen);

// Options that several commands have.

/// Declares --runs, --seed and --set.
/// @param overrides  Lives as long as the command.
void add_override_options(CLI::App& command, Overrides& overrides);

/// Why a campaign with --failures was cancelled, for standard error.
/// @param num_failures  Runs given up or without an estimate.
[[nodiscard]] std::string too_many_failures_text(std::uint64_t num_failures, std::uint64_t num_runs,
                                                 std::uint64_t failures_max);

/// A requirement about a quantity of the example, for help texts: `gain < 1e-3 for 99% with 95%`.
[[nodiscard]] std::string example_requirement();

/// Declares --until and --failures.
/// @param options  Lives as long as the command.
void add_stop_options(CLI::App& command, StopPlan& options);

/// Declares --audit.
/// @param audit_fraction  Lives as long as the command.
void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction);

/// Declares `--page` and `--page-token-file`. The flag takes an address only behind a `=`, so that
/// a file name after it is not taken for one.
void add_page_options(CLI::App& app, PageConfig& page);

}  // namespace proofmass::coordinator
