#include "core/error.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace proofmass {
namespace {

/// A message is one line, and ends where its text does.
std::string without_controls(std::string_view value) {
  std::string text;
  for (const char c : value) {
    const bool is_control = static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    text += is_control ? fmt::format("\\u{:04X}", static_cast<unsigned>(c)) : std::string(1, c);
  }
  return text;
}

}  // namespace

ConfigError::ConfigError(std::string_view field, std::string_view value, std::string_view rule)
    : Error(fmt::format("{} = {} ({})", field, without_controls(value), rule)), field_(field) {}

namespace detail {

void expectation_failed(const char* condition, const char* file, int line) {
  (void)std::fprintf(stderr, "%s:%d: internal invariant broken: %s\n", file, line, condition);
  std::abort();
}

}  // namespace detail
}  // namespace proofmass
