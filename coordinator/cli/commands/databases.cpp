#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/independence.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

struct CompareOptions {
  std::filesystem::path first;
  std::filesystem::path second;
  std::vector<std::filesystem::path> others;
  OutputFormat format = OutputFormat::text;
};

/// A file that is compared with itself is a slip.
void refuse_same_files(std::span<const std::filesystem::path> files) {
  for (std::size_t i = 1; i < files.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      std::error_code error;  // A file that is not there is refused when it is opened.
      if (!std::filesystem::equivalent(files[i], files[j], error)) continue;
      throw UsageError(
          fmt::format("DB = {} (is the same file as {})", files[i].string(), files[j].string()));
    }
  }
}

int compare_databases(const CompareOptions& options, const HeedStop& heed_stop) {
  std::vector<std::filesystem::path> files{options.first, options.second};
  files.insert(files.end(), options.others.begin(), options.others.end());
  if (files.size() > num_compared_max) {
    throw UsageError(
        fmt::format("DB = {} files (must be at most {})", files.size(), num_compared_max));
  }
  refuse_same_files(files);
  const std::vector<ComparedCampaign> members = compare_several(files, heed_stop);
  if (options.format == OutputFormat::json) {
    print_json(comparison_json(members));
  } else {
    write_standard_output(
        comparison_text(members, lettered(members.size()), style_of(stdout).paint));
  }
  for (const ComparedCampaign& member : members) {
    const std::string why = why_not_independent(*member.campaign);
    if (why.empty()) continue;
    throw UsageError(
        fmt::format("DB = {} (needs independent draws: {})", member.file.string(), why));
  }
  const bool is_compared = std::ranges::all_of(members, [](const ComparedCampaign& member) {
    return !member.comparison || member.comparison->why_not_compared.empty();
  });
  return is_compared ? exit_done : exit_cannot_be_done;
}

}  // namespace

void add_compare(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<CompareOptions>(
      app, chosen, "compare", "Compare the results of campaigns", compare_databases);
  add_database(command, options.first, "A");
  add_database(command, options.second, "B");
  add_path(command, database_type, "DB", options.others,
           "Further databases: each is compared with A");
  add_json_flag(command, options.format);
}

namespace {

enum class ExportFormat : std::uint8_t { hdf5, sqlite };

struct ExportOptions {
  std::filesystem::path database;
  ExportFormat format = ExportFormat::hdf5;
  std::filesystem::path output;
  wire::IfThere if_there = wire::IfThere::keep;
  DrawColumns draws = DrawColumns::left_out;
};

int export_results(const ExportOptions& options, const HeedStop& heed_stop) {
  if (options.format == ExportFormat::sqlite && options.draws == DrawColumns::included) {
    throw UsageError("draws = (must not be given with --format sqlite)");
  }
  check_output_file(options.output, options.if_there, "name one that may be replaced");
  const Store store = Store::open_read_only(options.database);
  if (options.format == ExportFormat::hdf5) {
    export_hdf5(store, options.output, heed_stop, options.draws);
  } else {
    export_sqlite(store, options.output, heed_stop);
  }
  print_written(options.output, OutputFormat::text);
  return exit_done;
}

struct ImportOptions {
  std::filesystem::path results;
  std::filesystem::path schema;
  std::filesystem::path database;
};

int import_file(const ImportOptions& options, const HeedStop& heed_stop) {
  check_new_file("db", options.database);
  const MissingEstimates missing =
      import_results(options.results, options.schema, options.database, heed_stop);
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
  add_path(command, wire::file_type, "--output", options.output, "File to write")->required();
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
  add_path(command, campaign_file_type, "--schema", options.schema,
           "TOML that says what its columns are")
      ->required();
  add_path(command, database_type, "--db", options.database, "Database to be made")->required();
}

namespace {

struct ListOptions {
  std::vector<std::filesystem::path> places;  ///< Files and directories; empty for this one.
  OutputFormat format = OutputFormat::text;
};

int list_databases(const ListOptions& options) {
  const std::vector<std::filesystem::path> here{"."};
  const auto campaigns = list_campaigns(options.places.empty() ? here : options.places);
  if (options.format == OutputFormat::json) {
    print_json(listing_json(campaigns));
  } else {
    TerminalStyle style = style_of(stdout);
    style.wraps_cells = true;  // Names that begin alike are told apart by their ends.
    write_standard_output(terminal_text(listing_table(campaigns), style));
  }
  return exit_done;
}

}  // namespace

void add_list(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ListOptions>(
      app, chosen, "list", "List the campaigns of directories and files", list_databases);
  add_path(command, database_type, "PLACE", options.places,
           "Directories, databases; this directory by default");
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
