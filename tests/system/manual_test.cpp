// Man pages and completions, as the build makes them, beside what the programs themselves say.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/proto/command_line/shell.hpp"
#include "tests/skip_for_want.hpp"
#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAreArray;

const std::filesystem::path share = std::filesystem::path(programs) / "../share";
const std::vector<std::string> names{"proofmass", "proofmass-coordinator", "proofmass-worker"};

std::string man_file(const std::string& program) {
  return (share / "man/man1" / (program + ".1")).string();
}
std::string bash_file(const std::string& program) {
  return (share / "bash-completion/completions" / program).string();
}
std::string zsh_file(const std::string& program) {
  return (share / "zsh/site-functions" / ("_" + program)).string();
}
std::string fish_file(const std::string& program) {
  return (share / "fish/vendor_completions.d" / (program + ".fish")).string();
}

std::string help_of(const std::string& program, const std::string& command) {
  return shell_answer(programs + "/" + program + " " + command + " --help").output;
}

/// The names that a help text declares: `-h` and `--help`.
std::vector<std::string> options_in(const std::string& help) {
  std::vector<std::string> options;
  std::istringstream stream(help);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("  -")) continue;
    std::istringstream list(line.substr(2, line.find(' ', 2) - 2));
    for (std::string name; std::getline(list, name, ',');) options.push_back(name);
  }
  return options;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// The commands that a help text lists behind its options, and the program itself, as "".
std::vector<std::string> commands_of(const std::string& program) {
  std::vector<std::string> commands{""};
  const std::string help = help_of(program, "");
  const std::size_t list = help.find("\n\n", help.find("\nOptions:\n"));
  for (const std::string& line : lines_of(help.substr(list, help.find("Exit codes:") - list))) {
    if (line.starts_with("  ") && line[2] != ' ') {
      commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  return commands;
}

std::string offered(const std::string& program, std::vector<std::string> words) {
  std::string function = "_" + program;
  std::ranges::replace(function, '-', '_');
  words.insert(words.begin(), program);
  return offered_by_bash(bash_file(program), function, words);
}

/// What fish offers for the end of a command line, one a line, without the descriptions.
std::vector<std::string> offered_by_fish(const std::string& program, const std::string& line) {
  const ShellAnswer answer = shell_answer("HOME=/tmp fish --no-config -c 'source " +
                                          fish_file(program) + "; complete -C \"" + line + "\"'");
  std::vector<std::string> offers = lines_of(answer.output);
  for (std::string& offer : offers) offer = offer.substr(0, offer.find('\t'));
  return offers;
}

/// The part of a man page about a command; without a command the part before all commands.
std::string part_about(const std::string& page, const std::string& command) {
  if (command.empty()) return page.substr(0, page.find("\n.SH COMMANDS\n"));
  const std::size_t begin = page.find("\n.SS \"proofmass " + command + " [OPTIONS]");
  return begin == std::string::npos ? "" : page.substr(begin, page.find("\n.S", begin + 1) - begin);
}

TEST(ManPages, HaveEachOptionOfEachCommandThatHelpShows) {
  if (!has_program("help2man")) return skip_for_want("help2man is not installed");
  EXPECT_THAT(commands_of("proofmass"), testing::IsSupersetOf({"run", "set-priority", "merge"}));
  for (const std::string& program : names) {
    const std::string page = read_file(man_file(program));
    for (const std::string& command : commands_of(program)) {
      const std::string part = part_about(page, command);
      for (const std::string& option : options_in(help_of(program, command))) {
        // Commands have these as the program has them.
        if (!command.empty() && (option == "-h" || option == "--help")) continue;
        std::string name;
        for (const char c : option) name += c == '-' ? std::string("\\-") : std::string(1, c);
        EXPECT_THAT(part, HasSubstr("\\fB" + name + "\\fR")) << program << " " << command;
      }
    }
  }
}

TEST(ManPages, AreFormattedWithoutAWarning) {
  if (!has_program("groff")) return skip_for_want("groff is not installed");
  for (const std::string& program : names) {
    EXPECT_EQ(shell_answer("groff -man -Tutf8 -ww -z " + man_file(program)).output, "");
  }
}

TEST(Completions, OfBashOfferWhatHelpShowsAndNothingElse) {
  for (const std::string& program : names) {
    std::vector<std::string> commands = commands_of(program);
    for (const std::string& command : commands) {
      std::vector<std::string> words{"-"};
      if (!command.empty()) words.insert(words.begin(), command);
      EXPECT_EQ(lines_of(offered(program, words)), options_in(help_of(program, command)))
          << program << " " << command;
    }
    commands.erase(commands.begin());
    if (commands.empty()) continue;
    EXPECT_EQ(lines_of(offered(program, {"''"})), commands);
  }
}

TEST(Completions, OfBashOfferValues) {
  EXPECT_EQ(offered("proofmass", {"export", "a.db", "--format", "''"}), "hdf5\nsqlite\n");
  EXPECT_EQ(offered("proofmass", {"plot", "a.db", "--format", "=", "p"}), "");
  EXPECT_EQ(offered("proofmass", {"status", "--connect", "tcp", ":", "//host", ":", "5555", "--k"}),
            "--keys\n");
  EXPECT_EQ(offered("proofmass", {"--config", "=", "query", "ini"}), "init\n");
  EXPECT_EQ(offered("proofmass-worker", {"--log-format", "=", "j"}), "json\n");
  const TemporaryDirectory directory;
  for (const char* name : {"a.toml", "a.db", "a.txt"}) std::ofstream(directory / name);
  const std::string here = (directory / "").string();
  EXPECT_EQ(offered("proofmass", {"run", here}), here + "a.toml\n");
  EXPECT_EQ(offered("proofmass", {"run", "a.toml", "--db", here}), here + "a.db\n");
  EXPECT_EQ(offered("proofmass", {"compare", "a.db", "b.db", "c.db", "d.db", here}),
            here + "a.db\n");
  EXPECT_EQ(offered("proofmass", {"query", "a.db", "b", here}), "");
  std::filesystem::create_directory(directory / "sub");
  EXPECT_EQ(offered("proofmass", {"query", "--keys", here}), here + "sub\n");
}

TEST(Completions, OfFishOfferWhatHelpShowsAndValues) {
  if (!has_program("fish")) return skip_for_want("fish is not installed");
  std::vector<std::string> commands = commands_of("proofmass");
  commands.erase(commands.begin());
  EXPECT_THAT(offered_by_fish("proofmass", "proofmass "), UnorderedElementsAreArray(commands));
  for (const std::string command : {"run", "query", "compare"}) {
    std::vector<std::string> options = options_in(help_of("proofmass", command));
    std::erase_if(options, [](const std::string& option) { return !option.starts_with("--"); });
    EXPECT_THAT(offered_by_fish("proofmass", "proofmass " + command + " --"),
                UnorderedElementsAreArray(options));
  }
  EXPECT_THAT(offered_by_fish("proofmass", "proofmass export --format "),
              ElementsAre("hdf5", "sqlite"));
}

TEST(Completions, OfZshHaveEachOptionAndValidSyntax) {
  for (const std::string& program : names) {
    const std::string zsh = read_file(zsh_file(program));
    for (const std::string& command : commands_of(program)) {
      for (const std::string& option : options_in(help_of(program, command))) {
        EXPECT_THAT(zsh, testing::AnyOf(HasSubstr("'" + option), HasSubstr("'*" + option)))
            << program << " " << command;
      }
    }
    if (!has_program("zsh")) return skip_for_want("zsh is not installed");
    EXPECT_EQ(shell_answer("zsh -f -n " + zsh_file(program)).output, "");
  }
}

}  // namespace
}  // namespace proofmass::test
