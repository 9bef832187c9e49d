#include "coordinator/archive/export.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "coordinator/cli/commands/commands.hpp"
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

int export_results(const ExportOptions& options, const IsStopped& is_stopped) {
  if (options.format == ExportFormat::sqlite && options.draws == DrawColumns::included) {
    throw UsageError("draws = (must not be given with --format sqlite)");
  }
  if (options.output == "-") refuse_output("-", "must be a file");
  check_output_file(options.output, options.if_there, "name one that may be replaced");
  const Store store = Store::open_read_only(options.database);
  if (options.format == ExportFormat::hdf5) {
    export_hdf5(store, options.output, is_stopped, options.draws);
  } else {
    export_sqlite(store, options.output, is_stopped);
  }
  return exit_done;
}

struct ImportOptions {
  std::filesystem::path results;
  std::filesystem::path schema;
  std::filesystem::path database;
};

int import_file(const ImportOptions& options, const IsStopped& is_stopped) {
  check_new_file("db", options.database);
  const MissingEstimates missing =
      import_results(options.results, options.schema, options.database, is_stopped);
  const Store store = Store::open_read_only(options.database);
  const std::string without = missing.total() == 0
                                  ? ""
                                  : fmt::format(", {} of them without an estimate ({})",
                                                missing.total(), reasons_text(missing));
  print_lines(fmt::format("imported {} runs into {}{}\nDigest {}\n", store.num_runs(),
                          options.database.string(), without, store.summary()->digests.results));
  return exit_done;
}

}  // namespace

void add_export(CLI::App& app, Command& chosen) {
  static const std::map<std::string, ExportFormat> formats{{"hdf5", ExportFormat::hdf5},
                                                           {"sqlite", ExportFormat::sqlite}};
  auto [command, options] = add_stoppable_command<ExportOptions>(
      app, chosen, "export", "Write all results in a format of other programs", export_results);
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

void add_import(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<ImportOptions>(
      app, chosen, "import", "Make a database of another program's results", import_file);
  command.add_option("RESULTS", options.results, "CSV with truths and estimates, a line a run")
      ->required();
  command.add_option("--schema", options.schema, "TOML that says what its columns are")
      ->type_name(campaign_file_type)
      ->required();
  command.add_option("--db", options.database, "Database to be made")
      ->type_name(database_type)
      ->required();
}

}  // namespace proofmass::coordinator
