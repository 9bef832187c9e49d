#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::wire {

// Type names of options whose values are paths; `--help` shows them behind the option's name, and
// completions offer files for them. `FILE.db` stands for files with that extension.
inline constexpr const char* file_type = "FILE";
inline constexpr const char* directory_type = "DIR";

/// What kind of value an option takes, as far as a shell can complete it.
enum class ValueKind : std::uint8_t {
  none,       ///< The option is a flag.
  text,       ///< Nothing can be offered.
  word,       ///< One of DescribedOption::words.
  file,       ///< A file, with DescribedOption::extension unless that is empty.
  directory,  ///< A directory.
};

/// An option (`--db FILE.db`) or a positional argument (`DB`) of a command.
struct DescribedOption {
  std::vector<std::string> names;  ///< `-h` and `--help`; for an argument its name alone.
  std::string text;                ///< The help text, on one line.
  ValueKind kind = ValueKind::none;
  std::string value_name;          ///< `UINT`, `FILE.db`, `csv|json`; empty for a flag.
  std::string range;               ///< `[1, 1024]`; empty if any value is valid.
  std::vector<std::string> words;  ///< All values of a ValueKind::word.
  std::string extension;           ///< `.db`; empty for files of any name.
  std::string default_value;       ///< Empty if the declaration does not know it.
  std::string variable;            ///< Environment variable; empty for none.
  bool is_required = false;
  bool is_repeatable = false;
};

/// An exit code and what it means.
struct DescribedExit {
  std::string code;
  std::string text;
};

/// A program, or a command of one.
struct DescribedCommand {
  std::string name;
  std::string text;                        ///< The help text, on one line.
  std::vector<DescribedOption> arguments;  ///< Positional arguments, in their order.
  std::vector<DescribedOption> options;
  std::vector<DescribedExit> exits;
  std::vector<DescribedCommand> commands;
};

/// What a program declares to its users, without its hidden options and commands (those of the
/// group ""). Exit codes are the lines of the footer that read `  CODE  TEXT`. A type name of words
/// joined by `|` lists all values of the option.
[[nodiscard]] DescribedCommand described_program(const CLI::App& app);

}  // namespace proofmass::wire
