#pragma once

#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

namespace proofmass::wire {

// Type names of options whose values are paths; `--help` shows them behind the option's name, and
// completions offer files for them (deploy/completions.awk). `FILE.db` stands for files with that
// extension.
inline constexpr const char* file_type = "FILE";
inline constexpr const char* directory_type = "DIR";

// What checks say is `value (rule)`; refusal_of() puts the option's name before it.

/// Takes numbers of a closed range. CLI11 alone would read -1 as the largest number without a sign.
template <typename Number>
[[nodiscard]] CLI::Validator in_range(Number minimum, Number maximum) {
  const auto check = [=](const std::string& text) {
    Number number{};
    const char* const end = text.data() + text.size();
    const auto parsed = std::from_chars(text.data(), end, number);
    const bool is_number = parsed.ec == std::errc{} && parsed.ptr == end;
    if (is_number && number >= minimum && number <= maximum) return std::string();
    const std::string_view kind = std::is_integral_v<Number> && !is_number ? "a whole number " : "";
    return fmt::format("{} (must be {}in [{}, {}])", text, kind, minimum, maximum);
  };
  return CLI::Validator(check, fmt::format("[{}, {}]", minimum, maximum), "in_range");
}

/// A time such as `90`, `90s`, `15m`, `2h` or `1d`, from 1 s to 366 d; nothing if it is none.
[[nodiscard]] std::optional<std::chrono::seconds> duration_from(std::string_view text);

/// Declares an option whose value is such a time.
/// @param target  Lives as long as the command.
template <typename Target>
CLI::Option* add_duration(CLI::App& command, const std::string& name, Target& target,
                          const std::string& description) {
  const auto check = [](const std::string& text) {
    if (duration_from(text)) return std::string();
    return text + " (must be 1 or more, in seconds or with s, m, h or d; at most 366d)";
  };
  return command
      .add_option_function<std::string>(
          name, [&target](const std::string& text) { target = *duration_from(text); }, description)
      ->check(CLI::Validator(check, "", "duration"));
}

/// Makes every option of the commands refuse the name of another one as its value, which shows that
/// its own was forgotten.
void refuse_options_as_values(CLI::App& app);

/// Takes one of some words.
[[nodiscard]] CLI::Validator one_of(const std::vector<std::string>& words);

/// Declares an option whose words stand for values; `--help` and completions show the words.
///
/// @param choices  Lives as long as the command, as does the target.
template <typename Value>
CLI::Option* add_choice(CLI::App& command, const std::string& name, Value& target,
                        const std::map<std::string, Value>& choices,
                        const std::string& description) {
  std::vector<std::string> words;
  for (const auto& [word, value] : choices) words.push_back(word);
  return command
      .add_option_function<std::string>(
          name, [&target, &choices](const std::string& word) { target = choices.at(word); },
          description)
      ->type_name(fmt::to_string(fmt::join(words, "|")))
      ->check(one_of(words));
}

/// Declares `--config`, which names a file with options. Options that the file should not have are
/// errors.
///
/// @param variable  Environment variable that names the file where no argument does; none if empty.
void add_option_file(CLI::App& app, const std::string& description,
                     const std::string& variable = {});

/// What to tell people whose arguments were refused: `option = value (rule)` where there is a
/// value, `VARIABLE = value (rule)` if it is from the environment, `config = FILE:LINE (rule)` for
/// a line of an option file.
[[nodiscard]] std::string refusal_of(const CLI::App& app, const CLI::ParseError& error);

}  // namespace proofmass::wire
