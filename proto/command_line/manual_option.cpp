#include "proto/command_line/manual_option.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/error.hpp"
#include "proto/command_line/completions.hpp"
#include "proto/command_line/described_program.hpp"
#include "proto/command_line/man_page.hpp"

namespace proofmass::wire {
namespace {

void write_file(const std::filesystem::path& file, const std::string& text) {
  std::error_code ignored;  // What keeps the directory from being made keeps the file from it too.
  std::filesystem::create_directories(file.parent_path(), ignored);
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream << text;
  stream.close();
  if (!stream) throw Error(fmt::format("manual = {} ({})", file.string(), std::strerror(errno)));
}

}  // namespace

void add_manual_option(CLI::App& app, const std::vector<std::string>& see_also) {
  const auto write = [&app, see_also](const std::string& directory) {
    const DescribedCommand program = described_program(app);
    const std::filesystem::path share = directory;
    const std::string& name = program.name;
    write_file(share / "man/man1" / (name + ".1"), man_page(program, app.version(), see_also));
    write_file(share / "bash-completion/completions" / name, bash_completion(program));
    write_file(share / "zsh/site-functions" / ("_" + name), zsh_completion(program));
    write_file(share / "fish/vendor_completions.d" / (name + ".fish"), fish_completion(program));
    throw CLI::Success();
  };
  app.add_option_function<std::string>("--write-manual", write)->group("")->configurable(false);
}

}  // namespace proofmass::wire
