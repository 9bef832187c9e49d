#include <filesystem>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"

namespace proofmass::coordinator {
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
  command.add_option("PLACE", options.places, "Directories, databases; this directory by default")
      ->type_name(database_type);
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
