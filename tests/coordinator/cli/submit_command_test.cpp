#include <gtest/gtest.h>

#include <fstream>

#include "coordinator/cli/commands/submit.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

class SubmitRequestOfAFile : public testing::Test {
 protected:
  SubmitRequestOfAFile() {
    std::ofstream(directory_ / "mine.toml") << "[campaign]\nname = \"mine\"\nruns = 7\n";
    options_.campaign_file = directory_ / "mine.toml";
  }

  test::TemporaryDirectory directory_;
  SubmitOptions options_;
};

TEST_F(SubmitRequestOfAFile, HasItsCampaign) {
  const wire::SubmitRequest request = submit_request(options_, *campaign_to_submit(options_));
  const MicroscopeCampaign campaign = campaign_of(request.definition);
  EXPECT_EQ(campaign.name, "mine");
  EXPECT_EQ(campaign.num_runs, 7U);
  EXPECT_EQ(request.priority, std::nullopt);
  EXPECT_EQ(request.audit_fraction, std::nullopt);
}

TEST_F(SubmitRequestOfAFile, HasWhatTheArgumentsReplace) {
  options_.name = "other";
  options_.priority = 3;
  options_.audit_fraction = 0.25;
  options_.overrides.num_runs = 9;
  options_.overrides.seed = 5;
  options_.overrides.assignments = {"noise.scale=0.5"};
  const wire::SubmitRequest request = submit_request(options_, *campaign_to_submit(options_));
  const MicroscopeCampaign campaign = campaign_of(request.definition);
  EXPECT_EQ(campaign.name, "other");
  EXPECT_EQ(campaign.num_runs, 9U);
  EXPECT_EQ(campaign.seed, 5U);
  EXPECT_EQ(campaign.scenario.noise.scale, 0.5);
  EXPECT_EQ(request.priority, 3);
  EXPECT_EQ(request.audit_fraction, 0.25);
}

TEST_F(SubmitRequestOfAFile, HasANameThatMayBeAFilesName) {
  options_.name = "../other";
  try {
    (void)campaign_to_submit(options_);
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(),
                 "campaign.name = \"../other\" (must be 1 to 64 letters, digits, _, - or .)");
  }
}

TEST(CampaignName, IsCheckedBeforeAnythingIsSent) {
  EXPECT_EQ(checked_campaign_name("hardy2013"), "hardy2013");
  try {
    (void)checked_campaign_name("a b");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "campaign = \"a b\" (must be 1 to 128 of [A-Za-z0-9._-])");
  }
}

}  // namespace
}  // namespace proofmass::coordinator
