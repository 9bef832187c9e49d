#include "coordinator/cli/init_command.hpp"

#include <gtest/gtest.h>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

TEST(Init, WritesACampaignThatCanBeRead) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "a.toml";
  EXPECT_EQ(write_campaign(file, IfFileExists::refuse), exit_done);
  EXPECT_TRUE(definition_differences(hardy2013_campaign(), *read_campaign(file)).empty());
}

TEST(Init, ReplacesAFileOnlyIfItMust) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "a.toml";
  (void)write_campaign(file, IfFileExists::refuse);
  try {
    (void)write_campaign(file, IfFileExists::refuse);
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_EQ(std::string(error.what()), file.string() + " exists (replace it with --force)");
  }
  EXPECT_EQ(write_campaign(file, IfFileExists::replace), exit_done);
}

TEST(Init, SaysWhyAFileCannotBeWritten) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "none" / "a.toml";
  try {
    (void)write_campaign(file, IfFileExists::refuse);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()), file.string() + ": No such file or directory");
  }
}

}  // namespace
}  // namespace proofmass::coordinator
