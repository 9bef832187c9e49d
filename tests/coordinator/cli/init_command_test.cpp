#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/program.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/model.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(Init, WritesACampaignThatCanBeRead) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "a.toml";
  EXPECT_EQ(test::answer_of({"init", file}).output, "wrote " + file.string() + "\n");
  EXPECT_TRUE(definition_differences(hardy2013_campaign(), *read_campaign(file)).empty());
}

TEST(Init, NamesTheFileAsTheModelDoes) {
  EXPECT_THAT(test::answer_of({"init", "--help"}).output, HasSubstr("FILE.toml=hardy2013.toml"));
}

TEST(Init, ReplacesAFileOnlyIfItMust) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "a.toml";
  (void)test::answer_of({"init", file});
  const test::Answer answer = test::answer_of({"init", file});
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_EQ(answer.error,
            "output = " + file.string() + " (exists already; replace it with --force)");
  EXPECT_EQ(test::answer_of({"init", file, "--force"}).exit_code, exit_done);
}

// As report and plot do; a database needs a file.
TEST(Init, WritesToStandardOutput) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(directory / "");
  const test::Answer answer = test::answer_of({"init", "-"});
  const bool is_empty = std::filesystem::is_empty(directory / "");
  std::filesystem::current_path(before);
  EXPECT_EQ(answer.output, model().example());
  EXPECT_TRUE(is_empty);
  EXPECT_EQ(test::answer_of({"backup", "a.db", "-"}).error,
            "destination = - (must be a file; ./- is one of that name)");
}

TEST(Init, SaysWhyAFileCannotBeWritten) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "none" / "a.toml";
  const test::Answer answer = test::answer_of({"init", file});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error,
            "output = " + file.string() + " (cannot be written: No such file or directory)");
}

// An empty file would be taken for a campaign file at the next attempt.
TEST(Init, LeavesNothingOnAFullDisk) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "a.toml";
  test::Answer answer;
  {
    const test::FileSizeLimit limit(4096);  // The file has more.
    answer = test::answer_of({"init", file});
  }
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "output = " + file.string() + " (cannot be written: File too large)");
  EXPECT_TRUE(std::filesystem::is_empty(file.parent_path()));
}

TEST(Help, ListsTheUsualCommandsFirst) {
  const std::string text = test::answer_of({"--help"}).output;
  EXPECT_THAT(text, testing::ContainsRegex("Run a campaign:\n  run .*\n\nLook at its results:\n  "
                                           "report .*\n\nAsk further questions:\n  query "
                                           ".*\n\nServe campaigns to other machines:\n  keygen "
                                           ".*\n\nKeep databases:\n  verify "));
  EXPECT_THAT(text, Not(HasSubstr("Subcommands:")));
}

TEST(Help, BeginsWithThePurposeOfTheModel) {
  EXPECT_THAT(test::answer_of({"--help"}).output,
              StartsWith("Validates the in-flight calibration of drag-free accelerometers.\n"));
}

// Only what a command can end with.
TEST(ExitCodes, AreThoseOfTheCommand) {
  const auto help_of = [](const std::string& command) {
    return test::answer_of({command, "--help"}).output;
  };
  for (const std::string command : {"init", "status", "release"}) {
    EXPECT_THAT(help_of(command), HasSubstr("  2    wrong usage"));
    EXPECT_THAT(help_of(command), Not(HasSubstr("  3    a requirement"))) << command;
    EXPECT_THAT(help_of(command), Not(HasSubstr("  130  interrupted"))) << command;
  }
  EXPECT_THAT(help_of("report"), HasSubstr("  3    a requirement"));
  EXPECT_THAT(help_of("verify"), HasSubstr("  130  interrupted"));
}

TEST(ClientOptions, MayComeFromTheEnvironment) {
  setenv("PROOFMASS_CLIENT_CONNECT", "nowhere", 1);
  const test::Answer answer = test::answer_of({"status"});
  unsetenv("PROOFMASS_CLIENT_CONNECT");
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_EQ(answer.error, "connect = nowhere (must be ipc://PATH or tcp://HOST:PORT)");
}

}  // namespace
}  // namespace proofmass::coordinator
