#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

enum class TagAction : std::uint8_t { print, add, remove };

struct TagOptions {
  std::filesystem::path database;
  TagAction action = TagAction::print;
  std::vector<std::string> tags;
};

int tag_database(const TagOptions& options) {
  if (options.action == TagAction::print) {
    for (const std::string& tag : Store::open_read_only(options.database).tags()) {
      print_lines(tag + "\n");
    }
    return exit_done;
  }
  if (options.tags.empty()) throw UsageError("TAG = (must be given after add and remove)");
  std::vector<Annotation> annotations;
  for (const std::string& tag : options.tags) {
    if (options.action == TagAction::add) {
      annotations.emplace_back(AddTag{tag});
    } else {
      annotations.emplace_back(RemoveTag{tag});
    }
  }
  Store::annotate(options.database, annotations);
  return exit_done;
}

}  // namespace

void add_tag(CLI::App& app, Command& chosen) {
  static const std::map<std::string, TagAction> actions{{"add", TagAction::add},
                                                        {"remove", TagAction::remove}};
  auto [command, options] = add_command<TagOptions>(
      app, chosen, "tag", "Add, remove or print tags of a campaign", tag_database);
  add_database(command, options.database);
  wire::add_choice(command, "ACTION", options.action, actions, "Without it prints the tags");
  command.add_option("TAG", options.tags, "1 to 64 letters, digits, dots, _ and -");
}

}  // namespace proofmass::coordinator
