#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "coordinator/cli/commands/commands.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

struct InitOptions {
  std::filesystem::path file = "hardy2013.toml";
  bool is_forced = false;  ///< Replaces an existing file.
};

int write_example(const InitOptions& options) {
  const std::string name = options.file.string();
  if (!options.is_forced && std::filesystem::exists(options.file)) {
    throw UsageError(fmt::format("{} exists (replace it with --force)", name));
  }
  std::ofstream stream(options.file, std::ios::binary | std::ios::trunc);
  stream << model().example();
  stream.close();
  if (!stream) throw Error(fmt::format("{}: {}", name, std::strerror(errno)));
  fmt::print("wrote {}\n", name);
  return exit_done;
}

}  // namespace

void add_init(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<InitOptions>(
      app, chosen, "init", "Write the paper's campaign file, commented", write_example);
  command.add_option("FILE", options.file, "File to write")
      ->type_name(campaign_file_type)
      ->capture_default_str();
  command.add_flag("--force", options.is_forced, "Replace an existing file");
}

}  // namespace proofmass::coordinator
