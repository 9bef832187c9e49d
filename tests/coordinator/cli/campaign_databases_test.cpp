#include "coordinator/cli/campaign_databases.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "coordinator/cli/program.hpp"
#include "coordinator/net/prepared_campaign.hpp"
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

namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

MicroscopeCampaign campaign_of(const std::string& name, std::uint64_t num_runs = 10) {
  MicroscopeCampaign campaign;
  campaign.name = name;
  campaign.num_runs = num_runs;
  return campaign;
}

class CampaignFolderTest : public testing::Test {
 protected:
  /// Names of the campaigns that can be loaded.
  std::vector<std::string> loaded(const CampaignFolder& folder) {
    std::vector<std::string> names;
    KnownCampaigns known;
    const CoordinatorStart start{.epoch = {7}, .host = "h", .version = "0"};
    for (const FileOutcome& outcome : look_at_all(folder, known, start)) {
      if (const auto* const prepared = std::get_if<PreparedCampaign>(&outcome)) {
        names.push_back(prepared->campaign.definition->name);
      } else {
        warnings.push_back(std::get<FileFailure>(outcome).reason);
      }
    }
    return names;
  }

  /// That of run 0.
  static void store_result(Store& store) {
    Delivery delivery{.result = test::zero_result({}), .worker = {1}, .attempt = {1}};
    const std::vector<Entry> entries{
        WorkerJoined{.session = {1}, .name = "w", .host = "h", .process_id = 1}, delivery};
    (void)store.write(entries);
  }

  test::TemporaryDirectory directory;
  std::vector<std::string> warnings;
};

TEST_F(CampaignFolderTest, IsMadeForThisUserOnly) {
  const CampaignFolder folder(directory / "deep/served");
  const auto permissions = std::filesystem::status(directory / "deep/served").permissions();
  EXPECT_EQ(permissions, std::filesystem::perms::owner_all);
}

TEST_F(CampaignFolderTest, HasOneCoordinator) {
  const CampaignFolder folder(directory / "served");
  try {
    const CampaignFolder second(directory / "served");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), "directory = " + (directory / "served").string() +
                                " (another coordinator serves it)");
  }
}

TEST_F(CampaignFolderTest, MayHaveAnotherCoordinatorAfterTheFirst) {
  { const CampaignFolder folder(directory / "served"); }
  EXPECT_NO_THROW(CampaignFolder(directory / "served"));
}

TEST_F(CampaignFolderTest, SaysWhyItCannotBeMade) {
  const auto reason = [](const std::filesystem::path& place) -> std::string {
    try {
      const CampaignFolder folder(place);
    } catch (const Error& error) {
      return error.what();
    }
    return "made";
  };
  const auto file = directory / "file";
  std::ofstream(file) << "no directory";
  EXPECT_EQ(reason(file), "directory = " + file.string() + " (is not a directory)");
  for (const auto& below : {file / "a", file / "a" / "b"}) {
    EXPECT_EQ(reason(below),
              "directory = " + below.string() + " (cannot be created: Not a directory)");
  }
}

TEST_F(CampaignFolderTest, KeepsEachCampaignInAFileOfItsName) {
  CampaignFolder folder(directory / "served");
  EXPECT_EQ(folder.open(campaign_of("b"), {}, {}).file, directory / "served/b.db");
  (void)folder.open(campaign_of("a"), {}, {});
  EXPECT_THAT(loaded(folder), UnorderedElementsAre("a", "b"));
  EXPECT_THAT(warnings, IsEmpty());
}

TEST_F(CampaignFolderTest, LeavesAloneWhatItCannotServe) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a"), {}, {});
  std::ofstream(directory / "served/b.db") << "something else";
  std::ofstream(directory / "served/notes.txt") << "something else";
  EXPECT_THAT(loaded(folder), ElementsAre("a"));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("b.db")));
  EXPECT_TRUE(std::filesystem::exists(directory / "served/b.db"));
}

TEST_F(CampaignFolderTest, ServesOneOfTwoCopies) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a"), {}, {});
  std::filesystem::copy_file(directory / "served/a.db", directory / "served/b.db");
  EXPECT_THAT(loaded(folder), ElementsAre("a"));
  EXPECT_THAT(warnings, ElementsAre((directory / "served/b.db").string() +
                                    ": campaign a is in another file as well"));
}

// Among them a backup whose name comes first, made before the results came. These are in the log
// only, as a coordinator that was killed leaves them.
TEST_F(CampaignFolderTest, ServesTheCopyWithTheMostResults) {
  CampaignFolder folder(directory / "served");
  const auto file = directory / "served/a.db";
  {
    ServedCampaign campaign = folder.open(campaign_of("a", 2), {}, {});
    campaign.store.back_up(directory / "served/a-backup.db");
    store_result(campaign.store);
    for (const std::string ending : {"", "-wal"}) {
      std::filesystem::copy_file(file.string() + ending, directory / ("killed" + ending));
    }
  }
  for (const std::string ending : {"", "-wal"}) {
    std::filesystem::rename(directory / ("killed" + ending), file.string() + ending);
  }
  EXPECT_THAT(loaded(folder), ElementsAre("a"));
  EXPECT_THAT(warnings, ElementsAre((directory / "served/a-backup.db").string() +
                                    ": campaign a is in another file as well"));
}

TEST_F(CampaignFolderTest, ServesOfEqualCopiesTheOneWithTheNameOfTheCampaign) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a"), {}, {});
  std::filesystem::copy_file(directory / "served/a.db", directory / "served/a-backup.db");
  EXPECT_THAT(loaded(folder), ElementsAre("a"));
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("a-backup.db: campaign a is in another file")));
}

TEST_F(CampaignFolderTest, OpensACampaignAgainAndExtendsIt) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a", 10), {}, {});
  ServedCampaign campaign = folder.open(campaign_of("a", 11), {}, {});
  EXPECT_EQ(campaign.store.num_runs(), 11U);
  EXPECT_EQ(folder.extend(campaign.store, campaign_of("a", 12))->num_runs, 12U);
  EXPECT_EQ(campaign.store.num_runs(), 12U);
}

TEST_F(CampaignFolderTest, OpensTheFileAgainThatACampaignHad) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a", 10), {}, {});
  const auto file = directory / "served/small.db";
  std::filesystem::rename(directory / "served/a.db", file);
  EXPECT_EQ(folder.open_again(file, campaign_of("a", 11), {}, {}).file, file);
  EXPECT_EQ(Store::open_read_only(file).num_runs(), 11U);
  EXPECT_FALSE(std::filesystem::exists(directory / "served/a.db"));
  std::filesystem::remove(file);
  EXPECT_THROW((void)folder.open_again(file, campaign_of("a", 11), {}, {}), StoreError);
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST_F(CampaignFolderTest, WritesTheOwnerIntoANewFileAndAsksItOfOneThatIsThere) {
  CampaignFolder folder(directory / "served");
  const Asker anna{.name = "anna", .rights = Rights::usual()};
  const Asker ben{.name = "ben", .rights = Rights::usual()};
  EXPECT_EQ(folder.open(campaign_of("a"), {}, anna).store.owner(), "anna");
  try {
    (void)folder.open(campaign_of("a", 11), {}, ben);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "campaign = a (belongs to anna; the key ben must have the right `control`)");
  }
  const Asker boss{.name = "boss", .rights = Rights::all()};
  EXPECT_EQ(folder.open(campaign_of("a", 11), {}, boss).store.owner(), "anna");
}

TEST_F(CampaignFolderTest, SaysHowTheCampaignInAFileDiffers) {
  CampaignFolder folder(directory / "served");
  (void)folder.open(campaign_of("a"), {}, {});
  MicroscopeCampaign other = campaign_of("a");
  other.seed = 2;
  try {
    (void)folder.open(other, {}, {});
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_EQ(error.what(), (directory / "served/a.db").string() +
                                " holds another campaign:\n"
                                "  seed: 1 in the database, 2 asked for\n"
                                "give the campaign another name");
  }
}

TEST_F(CampaignFolderTest, BringsStatisticsUpToDateBesideTheWriter) {
  CampaignFolder folder(directory / "served");
  ServedCampaign campaign = folder.open(campaign_of("a", 1), {}, {});
  store_result(campaign.store);
  int num_writes = 0;
  folder.summarise(campaign.file, *campaign.definition,
                   [&](const std::function<void(Store&)>& action) {
                     ++num_writes;
                     action(campaign.store);
                   });
  EXPECT_EQ(num_writes, 1);
}

}  // namespace
}  // namespace proofmass::coordinator
