#include <fmt/format.h>

#include <filesystem>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

struct InitOptions {
  std::filesystem::path file = model().example_file();
  wire::IfThere if_there = wire::IfThere::keep;
};

int write_example(const InitOptions& options) {
  check_document(options.file, options.if_there);
  write_document(options.file, options.if_there, model().example());
  if (options.file != "-") fmt::print("wrote {}\n", options.file.string());
  return exit_done;
}

}  // namespace

void add_init(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<InitOptions>(
      app, chosen, "init", "Write an example of a campaign file, commented", write_example);
  command.add_option("FILE", options.file, "File to write; - for standard output")
      ->type_name(campaign_file_type)
      ->capture_default_str();
  add_force_flag(command, options.if_there);
}

}  // namespace proofmass::coordinator
