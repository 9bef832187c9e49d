#include <filesystem>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {
namespace {

struct BackupOptions {
  std::filesystem::path database;
  std::filesystem::path destination;
  OutputFormat format = OutputFormat::text;
};

int back_up_database(const BackupOptions& options, const HeedStop& heed_stop) {
  check_new_file("destination", options.destination);
  const Store store = Store::open_read_only(options.database);
  // A copy may be all that is left some day: one of a damaged file must not pass for a good one.
  check_definition_digest(store);
  (void)walk_checked(store, [&](const RunResult&) { heed_stop(); });
  store.back_up(options.destination, heed_stop);
  print_written(options.destination, options.format);
  return exit_done;
}

}  // namespace

void add_backup(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<BackupOptions>(
      app, chosen, "backup", "Copy a database, even while it is written", back_up_database);
  add_database(command, options.database);
  add_path(command, database_type, "DESTINATION", options.destination, "File to make")->required();
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
