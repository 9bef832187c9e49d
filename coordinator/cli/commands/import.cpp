#include <fmt/format.h>

#include <filesystem>

#include "coordinator/archive/result_import.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/stop_signals.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct ImportOptions {
  std::filesystem::path results;
  std::filesystem::path schema;
  std::filesystem::path database;
};

int import_file(const ImportOptions& options) {
  check_new_file("db", options.database);
  return run_until_stopped([&](const IsStopped& is_stopped) {
    import_results(options.results, options.schema, options.database, is_stopped);
    const Store store = Store::open_read_only(options.database);
    print_lines(fmt::format("imported {} runs into {}\nDigest {}\n", store.num_runs(),
                            options.database.string(), store.summary()->digests.results));
    return exit_done;
  });
}

}  // namespace

void add_import(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ImportOptions>(
      app, chosen, "import", "Make a database of another program's results", import_file);
  command.footer(exit_codes_text({exit_interrupted}));
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
