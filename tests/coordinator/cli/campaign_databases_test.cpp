#include "coordinator/cli/campaign_databases.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "coordinator/cli/program.hpp"
#include "coordinator/net/directory_look.hpp"
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

// Both say how many runs there are.
TEST(CampaignStart, DefinesAsManyRunsAsTheFileHasUntilAStopRuleIsChecked) {
  const test::TemporaryDirectory directory;
  const StopPlan plan{.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1000, .failures_max = {}};
  const ServedCampaign served = open_or_create(campaign_of(1000), plan, directory / "a.db");
  EXPECT_EQ(served.store.num_runs(), 128U);
  EXPECT_EQ(served.store.definition(), canonical_definition(campaign_of(128)));
}

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
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
    for (const FileLook& look : look_at_all(folder, known, start)) {
      if (look.store) {
        names.push_back(look.record.status.name);
      } else {
        warnings.push_back(look.failure);
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
