#include "coordinator/cli/campaign_start.hpp"

#include <gtest/gtest.h>

#include "coordinator/cli/exit_code.hpp"
#include "coordinator/store/detail/database.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

MicroscopeCampaign campaign_of(std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  return campaign;
}

std::string refusal(const MicroscopeCampaign& wanted, const std::filesystem::path& database) {
  try {
    (void)open_or_create(wanted, {}, database);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(CampaignStart, MakesTheDatabaseAndOpensItAgain) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  EXPECT_EQ(open_or_create(campaign_of(10), {}, database).store.num_runs(), 10U);
  EXPECT_EQ(open_or_create(campaign_of(10), {}, database).store.num_runs(), 10U);
}

TEST(CampaignStart, RefusesAnotherCampaignAndSaysWhatDiffers) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  (void)open_or_create(campaign_of(10), {}, database);
  MicroscopeCampaign other = campaign_of(10);
  other.seed = 2;
  EXPECT_EQ(refusal(other, database), database.string() +
                                          " holds another campaign:\n"
                                          "  seed: 1 in the database, 2 asked for\n"
                                          "name another database with --db");
}

// Half of a campaign from one model and half from another would be neither's.
TEST(CampaignStart, RefusesACampaignThatAnotherModelBegan) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  (void)open_or_create(campaign_of(10), {}, database);
  // The digest is of the model's version as well; files from before schema 6 have none.
  detail::Database(database, detail::Access::read_write)
      .execute("UPDATE campaign SET model_version = 'older', table_digest = ''");
  EXPECT_EQ(refusal(campaign_of(10), database),
            database.string() + " holds another campaign:\n  model: older in the database, " +
                std::string(model_version) + " in this program\nname another database with --db");
}

TEST(CampaignStart, ExtendsToMoreRuns) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  (void)open_or_create(campaign_of(10), {}, database);
  EXPECT_EQ(open_or_create(campaign_of(12), {}, database).store.num_runs(), 12U);
}

TEST(CampaignStart, RefusesFewerRunsThanBefore) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  (void)open_or_create(campaign_of(10), {}, database);
  EXPECT_EQ(refusal(campaign_of(9), database),
            "campaign.runs = 9 (must be at least 10, which " + database.string() +
                " was asked for; the number comes from --runs, or else from the campaign file)");
}

// A rule that has not been checked leaves a campaign unfinished.
TEST(CampaignStart, TakesUpAFinishedCampaignUnderANewStopRule) {
  const test::TemporaryDirectory directory;
  const auto database = directory / "a.db";
  {
    Store store = open_or_create(campaign_of(128), {}, database).store;
    const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
    (void)store.write({&finished, 1});
  }
  const StopPlan plan{.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1000, .failures_max = {}};
  const ServedCampaign served = open_or_create(campaign_of(1000), plan, database);
  EXPECT_EQ(served.definition->num_runs, 128U);
  EXPECT_EQ(served.store.stop_plan(), plan);
  EXPECT_EQ(served.store.control().phase, wire::CampaignPhase::active);
}

// Both say how many runs there are.
TEST(CampaignStart, DefinesAsManyRunsAsTheFileHasUntilAStopRuleIsChecked) {
  const test::TemporaryDirectory directory;
  const StopPlan plan{.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1000, .failures_max = {}};
  const ServedCampaign served = open_or_create(campaign_of(1000), plan, directory / "a.db");
  EXPECT_EQ(served.store.num_runs(), 128U);
  EXPECT_EQ(served.store.definition(), canonical_definition(campaign_of(128)));
}

// Its tables have a row for each run, and nobody knows yet how many there will be.
TEST(CampaignStart, RefusesAStopRuleWithTables) {
  const test::TemporaryDirectory directory;
  MicroscopeCampaign campaign = campaign_of(2);
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{1e-4, 2e-4}};
  const StopPlan plan{.stop_rule = "mean(k2c) within 5%", .num_runs_max = 2, .failures_max = {}};
  try {
    (void)open_or_create(campaign, plan, directory / "a.db");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(),
                 "until = mean(k2c) within 5% (must not be with quantities whose law is a table)");
  }
}

TEST(CampaignStart, ReadsACampaignWithTablesBack) {
  const test::TemporaryDirectory directory;
  MicroscopeCampaign campaign = campaign_of(3);
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.dispersions[9] = {.law = Law::table, .file = "f.csv", .column = "b"};
  campaign.table_columns = {{1e-4, 2e-4, 3e-4}, {1e-3, -2e-3, 0.1}};
  const Store store = open_or_create(campaign, {}, directory / "a.db").store;
  const MicroscopeCampaign stored = test::microscope(*stored_campaign(store));
  EXPECT_EQ(stored.table_columns, campaign.table_columns);
  EXPECT_EQ(stored.dispersions, campaign.dispersions);
  EXPECT_TRUE(definition_differences(stored, campaign).empty());
}

}  // namespace
}  // namespace proofmass::coordinator
