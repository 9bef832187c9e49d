#include "coordinator/cli/standard_output.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>
#include <string>

#include "coordinator/cli/painting.hpp"
#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void fail_to_write() {
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

}  // namespace

ScreenSize screen_size_of(std::FILE* stream) {
  winsize size{};
  const bool is_known = ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  if (!is_known) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

std::size_t line_width_max_of(std::FILE* stream) {
  if (isatty(fileno(stream)) == 0) return std::numeric_limits<std::size_t>::max();
  return screen_size_of(stream).columns - 1;
}

void print_lines(std::string_view text) { write_standard_output(wire::visible_lines(text)); }

void print_tables(std::string_view text) {
  const std::string visible = wire::visible_lines(text);
  write_standard_output(takes_paint(stdout) ? painted(visible) : visible);
}

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

}  // namespace proofmass::coordinator
