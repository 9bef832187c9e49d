#include "coordinator/archive/export.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "coordinator/archive/result_columns.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output_file.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/described_program.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/surroundings.hpp"

namespace proofmass::coordinator {
namespace {

enum class ExportFormat : std::uint8_t { csv, json, hdf5, sqlite };

struct ExportOptions {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::csv;
  std::filesystem::path output;  ///< Empty or `-` for standard output.
  wire::IfThere if_there = wire::IfThere::keep;
  DrawColumns draws = DrawColumns::left_out;
};

bool is_standard_output(const std::filesystem::path& output) {
  return output.empty() || output == "-";
}

void check(const ExportOptions& options) {
  if (options.format == ExportFormat::sqlite && options.draws == DrawColumns::included) {
    throw UsageError("draws = (must not be given with --format sqlite)");
  }
  if (!is_standard_output(options.output)) {
    check_output_file(options.output, options.if_there,
                      "leave --output out to write to a pipe or device");
  } else if (options.format == ExportFormat::hdf5 || options.format == ExportFormat::sqlite) {
    refuse_output("-", "must be a file for hdf5 and sqlite: name it with --output");
  }
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
  } else if (options.format == ExportFormat::sqlite) {
    export_sqlite(store, options.output, is_stopped);
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
  wire::ignore_broken_pipes();  // A reader that goes away is an error like any other.
  return run_until_stopped([&](const IsStopped& is_stopped) {
    write(options, is_stopped);
    return exit_done;
  });
}

}  // namespace

void add_export(CLI::App& app, Command& chosen) {
  static const std::map<std::string, ExportFormat> formats{{"csv", ExportFormat::csv},
                                                           {"json", ExportFormat::json},
                                                           {"hdf5", ExportFormat::hdf5},
                                                           {"sqlite", ExportFormat::sqlite}};
  auto [command, options] = add_command<ExportOptions>(
      app, chosen, "export", "Write all results in a format of other programs", export_results);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  wire::add_choice(command, "--format", options.format, formats, "csv by default");
  command.add_option("--output", options.output, "File; standard output by default")
      ->type_name(wire::file_type);
  add_force_flag(command, options.if_there);
  command.add_flag_callback(
      "--draws", [&draws = options.draws] { draws = DrawColumns::included; },
      "Add columns draw_... with what each run drew");
}

}  // namespace proofmass::coordinator
