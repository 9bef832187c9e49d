#include "coordinator/cli/standard_output.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "core/error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void fail_to_write() {
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

}  // namespace

void print_lines(std::string_view text) { write_standard_output(wire::visible_lines(text)); }

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

}  // namespace proofmass::coordinator
