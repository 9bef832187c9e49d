#include "coordinator/cli/standard_output.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "core/error.hpp"
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

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

}  // namespace proofmass::coordinator
