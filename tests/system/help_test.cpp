// What people read first.

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

/// The programs are called by a long path, which must not get into what they print.
class Help : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory_symlink(programs, long_path_); }

  [[nodiscard]] std::string help_of(const std::string& program, const Arguments& arguments) const {
    Process process(directory_ / "", "help", long_path_ + "/" + program, arguments);
    EXPECT_EQ(process.wait(), 0) << program;
    return read_file(directory_ / "help.out");
  }

  static void expect_fits(const std::string& text) {
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) EXPECT_LE(line.size(), 80U) << line;
  }

 private:
  TemporaryDirectory directory_;
  std::string long_path_ = directory_ / std::string(80, 'p');
};

/// The commands that the help of `proofmass` lists.
std::vector<std::string> commands_in(const std::string& text) {
  std::istringstream stream(text.substr(text.find("Subcommands:\n")));
  std::string line;
  std::getline(stream, line);
  std::vector<std::string> commands;
  while (std::getline(stream, line) && line.starts_with("  ")) {
    commands.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return commands;
}

TEST_F(Help, FitsATerminal) {
  const std::string text = help_of("proofmass", {"--help"});
  expect_fits(text);
  const std::vector<std::string> commands = commands_in(text);
  EXPECT_GT(commands.size(), 10U);
  for (const std::string& command : commands) {
    expect_fits(help_of("proofmass", {command, "--help"}));
  }
  expect_fits(help_of("proofmass-coordinator", {"--help"}));
  expect_fits(help_of("proofmass-worker", {"--help"}));
}

}  // namespace
}  // namespace proofmass::test
