#include "coordinator/cli/standard_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "coordinator/query/display_text.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void fail_to_write() {
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

}  // namespace

std::string visible_lines(std::string_view text) {
  std::string visible;
  while (!text.empty()) {
    const std::size_t size = std::min(text.find('\n'), text.size());
    visible += visible_text(text.substr(0, size));
    if (size < text.size()) visible += '\n';
    text.remove_prefix(std::min(size + 1, text.size()));
  }
  return visible;
}

void print_lines(std::string_view text) { write_standard_output(visible_lines(text)); }

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

}  // namespace proofmass::coordinator
