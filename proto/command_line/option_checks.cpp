#include "proto/command_line/option_checks.hpp"

#include <fmt/ranges.h>

#include <algorithm>

namespace proofmass::wire {

CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& text) {
    if (std::ranges::find(words, text) != words.end()) return std::string();
    return fmt::format("{} (must be one of {})", text, fmt::join(words, ", "));
  };
  return CLI::Validator(check, "", "one_of");
}

std::string refusal_of(const CLI::App& app, const CLI::ParseError& error) {
  std::string text = error.what();
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) {
    // CLI11 says `name: ` before what a check says.
    if (const std::size_t colon = text.find(": "); colon != text.npos) text.replace(colon, 1, " =");
    return text;
  }
  const bool needs_command = app.get_require_subcommand_min() > 0;
  if (needs_command && app.get_subcommands().empty() && app.remaining_size() > 0) {
    return "command = " + app.remaining().front() + " (must be one that --help lists)";
  }
  return text;
}

}  // namespace proofmass::wire
