#include "proto/command_line/option_checks.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace proofmass::wire {
namespace {

// CLI11 says `name: ` before what a check says.
std::string with_equals_sign(std::string text) {
  if (const std::size_t colon = text.find(": "); colon != text.npos) text.replace(colon, 1, " =");
  return text;
}

// What CLI11 says of arguments and option files, worded as everything else.
std::string reworded(std::string text) {
  const auto reword = [&](std::string_view begin, std::string_view end, std::string_view field,
                          std::string_view rule) {
    if (!text.starts_with(begin) || !text.ends_with(end)) return;
    const std::size_t size = text.size() - begin.size() - end.size();
    text = fmt::format("{} = {} ({})", field, text.substr(begin.size(), size), rule);
  };
  constexpr std::string_view rule = "not expected; --help tells what is";
  reword("The following argument was not expected: ", "", "argument", rule);
  reword("The following arguments were not expected: ", "", "arguments", rule);
  reword("INI was not able to parse ", "", "config", "is no option");
  reword("", " was not readable (missing?)", "config", "cannot be read");
  return text;
}

}  // namespace

CLI::Validator one_of(const std::vector<std::string>& words) {
  const auto check = [words](const std::string& text) {
    if (std::ranges::find(words, text) != words.end()) return std::string();
    return fmt::format("{} (must be one of {})", text, fmt::join(words, ", "));
  };
  return CLI::Validator(check, "", "one_of");
}

std::string refusal_of(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return with_equals_sign(text);
  const bool needs_command = app.get_require_subcommand_min() > 0;
  if (needs_command && app.get_subcommands().empty() && app.remaining_size() > 0) {
    return "command = " + app.remaining().front() + " (must be one that --help lists)";
  }
  return reworded(text);
}

}  // namespace proofmass::wire
