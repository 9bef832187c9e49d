#include "core/error.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>

namespace proofmass {

ConfigError::ConfigError(std::string_view field, std::string_view value, std::string_view rule)
    : Error(fmt::format("{} = {} ({})", field, value, rule)), field_(field) {}

namespace detail {

void expectation_failed(const char* condition, const char* file, int line) {
  (void)std::fprintf(stderr, "%s:%d: internal invariant broken: %s\n", file, line, condition);
  std::abort();
}

}  // namespace detail
}  // namespace proofmass
