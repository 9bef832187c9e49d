#include "coordinator/archive/export.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

enum class ExportFormat : std::uint8_t { hdf5, sqlite };

struct ExportOptions {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::hdf5;
  std::filesystem::path output;
  wire::IfThere if_there = wire::IfThere::keep;
  DrawColumns draws = DrawColumns::left_out;
};

int export_results(const ExportOptions& options) {
  if (options.format == ExportFormat::sqlite && options.draws == DrawColumns::included) {
    throw UsageError("draws = (must not be given with --format sqlite)");
  }
  if (options.output == "-") refuse_output("-", "must be a file");
  check_output_file(options.output, options.if_there, "name one that may be replaced");
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const Store store = Store::open_read_only(options.database);
    if (options.format == ExportFormat::hdf5) {
      export_hdf5(store, options.output, is_stopped, options.draws);
    } else {
      export_sqlite(store, options.output, is_stopped);
    }
    return exit_done;
  });
}

}  // namespace

void add_export(CLI::App& app, Command& chosen) {
  static const std::map<std::string, ExportFormat> formats{{"hdf5", ExportFormat::hdf5},
                                                           {"sqlite", ExportFormat::sqlite}};
  auto [command, options] = add_command<ExportOptions>(
      app, chosen, "export", "Write all results in a format of other programs", export_results);
  command.footer(exit_codes_text({exit_interrupted}));
  add_database(command, options.database);
  wire::add_choice(command, "--format", options.format, formats, "hdf5 by default");
  command.add_option("--output", options.output, "File to write")
      ->type_name(wire::file_type)
      ->required();
  add_force_flag(command, options.if_there);
  command.add_flag_callback(
      "--draws", [&draws = options.draws] { draws = DrawColumns::included; },
      "Add what each run drew");
}

}  // namespace proofmass::coordinator
