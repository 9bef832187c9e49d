#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/page/page.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/table/table.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass {
class Model;
}  // namespace proofmass

namespace proofmass::coordinator {

struct ScreenSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};

/// Size of the terminal; the default if it is none.
[[nodiscard]] ScreenSize screen_size_of(std::FILE* stream);

/// True if the stream is a terminal that obeys control sequences: TERM is neither unset nor `dumb`.
[[nodiscard]] bool takes_escapes(std::FILE* stream);

/// How tables are written to the stream. A line may take the columns of the terminal but the last,
/// or any number if the stream is a file or a pipe. A terminal that obeys control sequences is
/// painted unless NO_COLOR is set and not empty (https://no-color.org).
[[nodiscard]] TerminalStyle style_of(std::FILE* stream);

enum class OutputFormat : std::uint8_t { text, json };

/// Says what a model program is asked for that may take long: Model::reference_digest().
void say_reference_runs(const Model& model);

void print_written(const std::filesystem::path& file, OutputFormat format);

// What is printed. Each throws Error `standard output: No space left on device`.

/// Prints lines, which may hold text of a file from elsewhere, as wire::visible_lines().
void print_lines(std::string_view text);

/// Prints an object as JSON; bytes that are no UTF-8 become U+FFFD.
void print_json(const nlohmann::ordered_json& json);

/// Writes bytes as they are: answers for programs, and text that is visible already, as that of
/// terminal_text().
void write_standard_output(std::string_view text);

/// Writes what is still buffered; without it a full disk goes unnoticed.
void flush_standard_output();

// Files.

/// @throws UsageError `output = path (why)`.
[[noreturn]] void refuse_output(const std::filesystem::path& output, std::string_view why);

/// Checks that a file may be written, or take the place of what has its name: a device or a
/// campaign would be lost.
/// @param remedy  What to tell people whose output is no file.
/// @throws UsageError `output = path (rule)`.
void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy);

/// check_output_file() for a text whose file may be `-`, standard output, or empty, none.
void check_document(const std::filesystem::path& file, wire::IfThere if_there);
/// @throws UsageError `output = path (rule)` if the output would take the place of an input.
void check_no_input(const std::filesystem::path& output,
                    std::initializer_list<std::filesystem::path> inputs);
/// Writes a file that is whole or not there at any time, or to standard output for `-`.
/// @throws Error `output = path (reason)`.
void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text);

/// Checks that a file can be made which replaces nothing.
/// @param argument  What names the file, for the message.
/// @throws UsageError `argument = path (exists already)`, or Error if the directory that is to hold
///         it does not exist.
void check_new_file(std::string_view argument, const std::filesystem::path& file);

// Commands.

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
                                        int (*run)(const Options&, const HeedStop&)) {
  const auto work = [run](const Options& options) {
    return run_until_stopped([&](const HeedStop& heed_stop) { return run(options, heed_stop); });
  };
  const auto declared = add_command<Options>(app, chosen, name, description, work);
  declared.command.footer(exit_codes_text({exit_interrupted}));
  return declared;
}

// The targets of the functions that declare options and arguments live as long as the command.

/// Declares --json.
inline void add_json_flag(CLI::App& command, OutputFormat& format) {
  command.add_flag_callback(
      "--json", [&format] { format = OutputFormat::json; }, "Print JSON");
}

/// Declares --force.
inline void add_force_flag(CLI::App& command, wire::IfThere& if_there) {
  command.add_flag_callback(
      "--force", [&if_there] { if_there = wire::IfThere::replace; }, "Replace an existing file");
}

/// Type names of campaign databases and campaign files, see wire::file_type.
inline constexpr const char* database_type = "FILE.db";
inline constexpr const char* campaign_file_type = "FILE.toml";

/// Declares an option or argument that names one file or several.
/// @param type  One of these types, or of wire.
template <typename Paths>
CLI::Option* add_path(CLI::App& command, const char* type, const std::string& name, Paths& paths,
                      const std::string& description) {
  return command.add_option(name, paths, description)->type_name(type);
}

/// Declares an argument that names a campaign database.
inline void add_database(CLI::App& command, std::filesystem::path& database,
                         const std::string& name = "DB") {
  add_path(command, database_type, name, database, "Database of a campaign")->required();
}

/// Declares the argument FILE, a campaign file.
inline void add_campaign_file(CLI::App& command, std::filesystem::path& file) {
  add_path(command, campaign_file_type, "FILE", file, "Campaign file (TOML)")->required();
}

/// The ends of the closed range that a number is in, see wire::in_range().
template <typename Number>
struct NumberRange {
  Number minimum;
  Number maximum;
};

/// Declares an option that takes a number; `--help` shows what the target has.
template <typename Number>
CLI::Option* add_number(CLI::App& command, const std::string& name, Number& target,
                        const std::type_identity_t<NumberRange<Number>>& range,
                        const std::string& description) {
  return command.add_option(name, target, description)
      ->check(wire::in_range(range.minimum, range.maximum))
      ->capture_default_str();
}

/// Declares one without a default.
template <typename Number>
CLI::Option* add_number(CLI::App& command, const std::string& name, std::optional<Number>& target,
                        const std::type_identity_t<NumberRange<Number>>& range,
                        const std::string& description) {
  return command.add_option(name, target, description)
      ->check(wire::in_range(range.minimum, range.maximum));
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

/// The commands under a heading of `--help`.
struct CommandGroup {
  std::string title;
  std::vector<void (*)(CLI::App& app, Command& chosen)> commands;
};

/// As `--help` lists them: the usual ones first.
[[nodiscard]] inline std::vector<CommandGroup> command_groups() {
  return {
      {"Run a campaign",
       {add_run, add_init, add_check, add_plan, add_sweep, add_environment, add_models}},
      {"Look at its results", {add_report, add_plot, add_list}},
      {"Ask further questions", {add_query, add_sensitivity, add_replay, add_compare}},
      {"Serve campaigns to other machines",
       {add_keygen, add_submit, add_status, add_watch, add_fetch, add_control, add_workers,
        add_release, add_factory}},
      {"Keep databases", {add_verify, add_backup, add_export, add_import, add_merge, add_publish}}};
}

/// Commands whose help has `--model-program`, although all take it: what they compute needs the
/// programs, and the others read what databases say of their models.
inline constexpr std::array<std::string_view, 10> commands_with_programs{
    "run", "init", "check", "sweep", "models", "replay", "submit", "verify", "merge", "publish"};

// Options that several commands have.

/// Declares --runs, --seed and --set.
void add_override_options(CLI::App& command, Overrides& overrides);

/// Why a campaign with --failures was cancelled, for standard error.
/// @param num_failures  Runs given up or without an estimate.
[[nodiscard]] std::string too_many_failures_text(std::uint64_t num_failures, std::uint64_t num_runs,
                                                 std::uint64_t failures_max);

/// A requirement about a quantity of the example, for help texts: `gain < 1e-3 for 99% with 95%`.
[[nodiscard]] std::string example_requirement();

/// Declares --until and --failures.
void add_stop_options(CLI::App& command, StopPlan& options);

/// Declares --audit.
void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction);

/// Declares `--page` and `--page-token-file`. The flag takes an address only behind a `=`, so that
/// a file name after it is not taken for one.
void add_page_options(CLI::App& app, PageConfig& page);

}  // namespace proofmass::coordinator
