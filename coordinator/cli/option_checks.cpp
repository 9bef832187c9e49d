#include "coordinator/cli/option_checks.hpp"

#include <fmt/ranges.h>

#include <algorithm>

namespace proofmass::coordinator {

CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& text) {
    if (std::ranges::find(words, text) != words.end()) return std::string();
    return fmt::format("{} (must be one of {})", text, fmt::join(words, ", "));
  };
  return CLI::Validator(check, "", "one_of");
}

}  // namespace proofmass::coordinator
