// What people read first.

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
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

  TemporaryDirectory directory_;

 private:
  std::string long_path_ = directory_ / std::string(80, 'p');
};

/// The commands that the help of `proofmass` lists.
std::vector<std::string> commands_in(const std::string& text) {
  const std::size_t begin = text.find("Run a campaign:\n");
  std::istringstream stream(text.substr(begin, text.find("Exit codes:\n") - begin));
  std::vector<std::string> commands;
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("  ") || line.at(2) == ' ') continue;  // A title, or a line that goes on.
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

// The READMEs promise them.
TEST_F(Help, NamesTheLimitsThatHoldUnlessToldOtherwise) {
  const std::string coordinator = help_of("proofmass-coordinator", {"--help"});
  EXPECT_TRUE(contains(coordinator, "--memory-max UINT:[64, 16777216]=2048 ")) << coordinator;
  EXPECT_TRUE(contains(coordinator, "--campaigns-per-key UINT:[1, 1000000]=100\n")) << coordinator;
  EXPECT_TRUE(contains(coordinator, "]=1073741824\n")) << coordinator;
}

class Usage : public Help {
 protected:
  /// What a program says on standard error, having refused its arguments.
  [[nodiscard]] std::string refusal_of(const std::string& program,
                                       const Arguments& arguments) const {
    Process process(directory_ / "", "refused", programs + "/" + program, arguments);
    EXPECT_EQ(process.wait(), 2);
    return read_file(directory_ / "refused.err");
  }
};

TEST_F(Usage, IsRefusedWithTheRule) {
  const std::vector<std::pair<Arguments, std::string>> cases{
      {{"raport", "a.db"}, "command = raport (must be one that --help lists; nearest is report)"},
      {{"run", "a.toml", "--runs", "-1"},
       "--runs = -1 (must be a whole number in [1, 1000000000])"},
      {{"run", "a.toml", "--seed", "-1"},
       "--seed = -1 (must be a whole number in [0, 9223372036854775807])"},
      {{"run", "a.toml", "--failures", "-1"},
       "--failures = -1 (must be a whole number in [0, 1000000000])"},
      {{"run", "a.toml", "--audit", "2"}, "--audit = 2 (must be in [0, 1])"},
      {{"run", "a.toml", "--workers", "0"}, "--workers = 0 (must be in [1, 1024])"},
      {{"run", "a.toml", "--until", "std(k2c) within 5"},
       "until = std(k2c) within 5 (must read \"STATISTIC(PARAMETER) within PERCENT%\", "
       "\"all objectives within PERCENT%\" or \"REQUIREMENT decided\")"},
      {{"export", "a.db", "--format", "xml"}, "--format = xml (must be one of hdf5, sqlite)"},
      {{"sensitivity", "a.db", "--run", "one"},
       "--run = one (must be a whole number in [0, 999999999])"},
  };
  for (const auto& [arguments, rule] : cases) {
    EXPECT_EQ(refusal_of("proofmass", arguments), "proofmass: error: " + rule + "\n");
  }
}

TEST_F(Usage, OfTheServicesIsRefusedWithTheRule) {
  EXPECT_EQ(refusal_of("proofmass-worker", {"--connect", "ipc:///tmp/a", "--threads", "-1"}),
            "proofmass-worker: error: --threads = -1 (must be a whole number in [1, 256])\n");
  EXPECT_EQ(refusal_of("proofmass-worker", {"--connect", "ipc:///tmp/a", "--end-time", "100"}),
            "proofmass-worker: error: end-time = 100 (must be in the future; from --end-time or "
            "SLURM_JOB_END_TIME)\n");
  EXPECT_EQ(refusal_of("proofmass-worker", {}), "proofmass-worker: error: --connect is required\n");
  EXPECT_EQ(refusal_of("proofmass-coordinator", {"--drain-time", "-1"}),
            "proofmass-coordinator: error: --drain-time = -1 (must be in [0, 31622400])\n");
}

}  // namespace
}  // namespace proofmass::test
