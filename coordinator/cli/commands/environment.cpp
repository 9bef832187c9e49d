#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/output.hpp"
#include "coordinator/cli/shared_options.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

struct EnvironmentOptions {
  std::filesystem::path file;
  Overrides overrides;
  EnvironmentRequest request;
  std::filesystem::path output;
  wire::IfThere if_there = wire::IfThere::keep;
};

int write_environment(const EnvironmentOptions& options) {
  check_document(options.output, options.if_there);
  const std::string text = environment_file(options.file, options.overrides, options.request);
  if (text.empty()) {
    throw UsageError(
        fmt::format("{}: campaigns of this model have no environment file", options.file.string()));
  }
  write_document(options.output, options.if_there, text);
  if (options.output != "-") fmt::print("wrote {}\n", options.output.string());
  return exit_done;
}

}  // namespace

void add_environment(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<EnvironmentOptions>(
      app, chosen, "environment", "Compute an environment file from physics", write_environment);
  add_campaign_file(command, options.file);
  command.add_option("--output", options.output, "File (CSV) to write; - for standard output")
      ->type_name(wire::file_type)
      ->required();
  command
      .add_option("--session", options.request.session,
                  "Session that it is for, if their spins differ")
      ->type_name("NAME");
  command.add_option("--physics", options.request.physics, "File (TOML) of what is not nominal")
      ->type_name(wire::file_type);
  add_force_flag(command, options.if_there);
  add_override_options(command, options.overrides);
}

}  // namespace proofmass::coordinator
