#include "coordinator/archive/export.hpp"

#include <fmt/format.h>

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>

#include "coordinator/archive/result_columns.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/described_program.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

enum class ExportFormat : std::uint8_t { csv, json, hdf5 };

struct ExportOptions {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::csv;
  std::filesystem::path output;  ///< Empty or `-` for standard output.
  bool is_forced = false;        ///< Replaces an existing file.
  DrawColumns draws = DrawColumns::left_out;
};

bool is_standard_output(const std::filesystem::path& output) {
  return output.empty() || output == "-";
}

[[noreturn]] void refuse(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

// The output takes the place of what has its name: a device or a campaign would be lost.
void check(const ExportOptions& options) {
  const std::filesystem::path& output = options.output;
  if (is_standard_output(output)) {
    if (options.format != ExportFormat::hdf5) return;
    refuse("-", "must be a file for hdf5: name it with --output");
  }
  std::error_code ignored;
  if (!std::filesystem::exists(output, ignored)) return;
  if (!options.is_forced) refuse(output, "exists already; replace it with --force");
  if (!std::filesystem::is_regular_file(output)) {
    refuse(output, "is no file; leave --output out to write to a pipe or device");
  }
  if (has_campaign_mark(output)) refuse(output, "is a campaign, which --force does not replace");
}

void write_text(const ExportOptions& options, const Store& store, TextOutput& output,
                const IsStopped& is_stopped) {
  if (options.format == ExportFormat::csv) {
    export_csv(store, output, is_stopped, options.draws);
  } else {
    export_json(store, output, is_stopped, options.draws);
  }
}

void write(const ExportOptions& options, const IsStopped& is_stopped) {
  const Store store = Store::open_read_only(options.database);
  if (options.format == ExportFormat::hdf5) {
    export_hdf5(store, options.output, is_stopped, options.draws);
  } else if (is_standard_output(options.output)) {
    TextOutput output;
    write_text(options, store, output, is_stopped);
  } else {
    TextOutput output(options.output);
    write_text(options, store, output, is_stopped);
  }
}

int export_results(const ExportOptions& options) {
  check(options);
  std::signal(SIGPIPE, SIG_IGN);  // A reader that goes away is an error like any other.
  return run_until_stopped([&](const IsStopped& is_stopped) {
    write(options, is_stopped);
    return exit_done;
  });
}

}  // namespace

void add_export(CLI::App& app, Command& chosen) {
  static const std::map<std::string, ExportFormat> formats{
      {"csv", ExportFormat::csv}, {"json", ExportFormat::json}, {"hdf5", ExportFormat::hdf5}};
  auto [command, options] = add_command<ExportOptions>(
      app, chosen, "export", "Write all results in a format of other programs", export_results);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  wire::add_choice(command, "--format", options.format, formats, "csv by default");
  command.add_option("--output", options.output, "File; standard output by default")
      ->type_name(wire::file_type);
  command.add_flag("--force", options.is_forced, "Replace an existing file");
  command.add_flag_callback(
      "--draws", [&draws = options.draws] { draws = DrawColumns::included; },
      "Add columns draw_... with what each run drew");
}

}  // namespace proofmass::coordinator
