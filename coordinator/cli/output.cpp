#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <system_error>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/json.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void fail_to_write() {
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

std::string_view value_of_variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : value;
}

}  // namespace

ScreenSize screen_size_of(std::FILE* stream) {
  winsize size{};
  const bool is_known = ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  if (!is_known) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

bool takes_escapes(std::FILE* stream) {
  const std::string_view terminal = value_of_variable("TERM");
  return isatty(fileno(stream)) != 0 && !terminal.empty() && terminal != "dumb";
}

TerminalStyle style_of(std::FILE* stream) {
  TerminalStyle style;
  if (isatty(fileno(stream)) != 0) style.line_width_max = screen_size_of(stream).columns - 1;
  const bool is_painted = takes_escapes(stream) && value_of_variable("NO_COLOR").empty();
  style.paint = is_painted ? Paint::yes : Paint::no;
  return style;
}

void print_lines(std::string_view text) { write_standard_output(wire::visible_lines(text)); }

void say_reference_runs(const Model& model) {
  wire::say(fmt::format("proofmass: computing the reference runs of {}\n", model.version()));
}

void print_written(const std::filesystem::path& file, OutputFormat format) {
  if (format == OutputFormat::json) return print_json({{"file", file.string()}});
  print_lines(fmt::format("wrote {}\n", file.string()));
}

void print_json(const nlohmann::ordered_json& json) { print_lines(dumped(json)); }

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

// Files.

void refuse_output(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy) {
  std::error_code ignored;
  if (std::filesystem::is_symlink(output, ignored)) {
    refuse_output(output, "is a symbolic link; name the file that it leads to");
  }
  if (!std::filesystem::exists(output, ignored)) return;
  if (if_there == wire::IfThere::keep) {
    refuse_output(output, "exists already; replace it with --force");
  }
  if (!std::filesystem::is_regular_file(output)) {
    refuse_output(output, fmt::format("is no file; {}", remedy));
  }
  if (has_campaign_mark(output)) {
    refuse_output(output, "is a campaign, which --force does not replace");
  }
}

void check_document(const std::filesystem::path& file, wire::IfThere if_there) {
  if (file.empty() || file == "-") return;
  check_output_file(file, if_there, "- writes to standard output");
}

void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text) {
  if (file == "-") return write_standard_output(text);
  wire::write_whole_file("output", file, text, wire::public_mode, if_there);
}

void check_new_file(std::string_view argument, const std::filesystem::path& file) {
  std::error_code error;
  if (file == "-") {
    throw UsageError(fmt::format("{} = - (must be a file; ./- is one of that name)", argument));
  }
  if (std::filesystem::exists(file, error)) {
    throw UsageError(fmt::format("{} = {} (exists already)", argument, file.string()));
  }
  if (!file.has_filename()) {
    throw UsageError(fmt::format("{} = \"{}\" (must name a file)", argument, file.string()));
  }
  const bool has_directory = std::filesystem::is_directory(wire::directory_of(file), error);
  if (has_directory || error == std::errc::permission_denied) return;  // Making it says more.
  throw Error(fmt::format("{} = {} (its directory does not exist)", argument, file.string()));
}

}  // namespace proofmass::coordinator
