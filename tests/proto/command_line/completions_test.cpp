#include "proto/command_line/completions.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/proto/command_line/example_program.hpp"
#include "tests/proto/command_line/shell.hpp"
#include "tests/skip_for_want.hpp"

namespace proofmass::wire {
namespace {

class Completion : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"with space.db", "b.txt"}) std::ofstream(directory_ / name);
    std::filesystem::create_directory(directory_ / "sub");
    const DescribedCommand program = test::ExampleProgram().described();
    std::ofstream(directory_ / "probe.bash") << bash_completion(program);
    std::ofstream(directory_ / "_space-probe") << zsh_completion(program);
    std::ofstream(directory_ / "probe.fish") << fish_completion(program);
  }

  /// What bash offers for the last word, which follows the program's name.
  [[nodiscard]] std::string offered(const std::vector<std::string>& words) const {
    std::vector<std::string> all{"space-probe"};
    all.insert(all.end(), words.begin(), words.end());
    return test::offered_by_bash(directory_ / "probe.bash", "_space_probe", all);
  }

  /// The beginning of names in the directory.
  [[nodiscard]] std::string here() const { return (directory_ / "").string(); }

  /// What fish offers for the end of a command line.
  [[nodiscard]] std::string offered_by_fish(const std::string& line) const {
    return test::shell_answer("cd " + here() +
                              " && HOME=. fish --no-config -c 'source probe.fish; complete -C \"" +
                              line + "\"'")
        .output;
  }

  const test::TemporaryDirectory directory_;
};

TEST_F(Completion, OfBashOffersCommandsAndOptions) {
  EXPECT_EQ(offered({"''"}), "send\ntag\n");
  EXPECT_EQ(offered({"s"}), "send\n");
  EXPECT_EQ(offered({"-"}), "-h\n--help\n--version\n-c\n--config\n");
  EXPECT_EQ(offered({"send", "--"}), "--help\n--format\n--runs\n--set\n--keys\n--force\n");
  EXPECT_EQ(offered({"send", "--fo"}), "--format\n--force\n");
  EXPECT_EQ(offered({"tag", "--"}), "--help\n");
}

TEST_F(Completion, OfBashOffersValues) {
  const std::string words = "$HOME's\njson\ntwo words\n";
  EXPECT_EQ(offered({"send", "--format", "''"}), words);
  EXPECT_EQ(offered({"send", "--format", "="}), words);
  EXPECT_EQ(offered({"send", "--format", "=", "js"}), "json\n");
  EXPECT_EQ(offered({"tag", "x.db", "j"}), "json\n");
  EXPECT_EQ(offered({"send", "--runs", "''"}), "");
}

TEST_F(Completion, OfBashOffersFilesWithTheExtensionAndDirectories) {
  const std::string databases = here() + "with space.db\n" + here() + "sub\n";
  EXPECT_EQ(offered({"send", here()}), databases);
  EXPECT_EQ(offered({"send", "a.db", "b.db", here()}), databases);
  EXPECT_EQ(offered({"send", "--keys", here()}), here() + "sub\n");
  EXPECT_EQ(offered({"-c", here() + "b"}), here() + "b.txt\n");
}

// The command is the first word that is neither an option nor the value of one, and so on.
TEST_F(Completion, OfBashTellsValuesFromArguments) {
  EXPECT_EQ(offered({"-c", "tag", "''"}), "send\ntag\n");
  EXPECT_EQ(offered({"--config", "=", "tag", "s"}), "send\n");
  EXPECT_EQ(offered({"tag", "--help", "x.db", "j"}), "json\n");
  EXPECT_EQ(offered({"tag", "tcp", ":", "//host", ":", "5555", "j"}), "json\n");
  EXPECT_EQ(offered({"tag", "x.db", "json", "j"}), "");
}

TEST_F(Completion, OfZshHasValidSyntax) {
  if (!test::has_program("zsh")) return test::skip_for_want("zsh is not installed");
  const test::ShellAnswer answer =
      test::shell_answer("zsh -f -n " + (directory_ / "_space-probe").string());
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.output, "");
}

TEST_F(Completion, OfFishOffersCommandsOptionsAndValues) {
  if (!test::has_program("fish")) return test::skip_for_want("fish is not installed");
  EXPECT_EQ(offered_by_fish("space-probe "),
            "send\tSend it's \"data\": [all], C:\\a $HOME ~ ^ | `x`\ntag\tMark\n");
  EXPECT_EQ(offered_by_fish("space-probe send --f"), "--force\t'''\n--format\tA\\B; %d -- 100 %\n");
  EXPECT_EQ(offered_by_fish("space-probe send --format "),
            "$HOME's\tA\\B; %d -- 100 %\njson\tA\\B; %d -- 100 %\n"
            "two words\tA\\B; %d -- 100 %\n");
  EXPECT_EQ(offered_by_fish("space-probe tag a.db js"), "json\n");
  EXPECT_EQ(offered_by_fish("space-probe send w"), "with space.db\n");
  EXPECT_EQ(offered_by_fish("space-probe send --keys s"), "sub/\tDirectory\n");
}

}  // namespace
}  // namespace proofmass::wire
