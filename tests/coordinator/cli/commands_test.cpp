#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/commands/run.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/net/campaign_files.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

MicroscopeCampaign campaign_of(std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  return campaign;
}

// Both say how many runs there are.
TEST(CampaignStart, DefinesAsManyRunsAsTheFileHasUntilAStopRuleIsChecked) {
  const test::ScratchDirectory directory;
  const StopPlan plan{.stop_rule = "mean(k2c) within 5%", .num_runs_max = 1000, .failures_max = {}};
  const ServedCampaign served = open_or_create(campaign_of(1000), plan, directory / "a.db");
  EXPECT_EQ(served.store.num_runs(), 128U);
  EXPECT_EQ(served.store.definition(), canonical_definition(campaign_of(128)));
}

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
    for (const FileLook& look : look_at_all(folder, known, start, 0)) {
      if (look.store) {
        names.push_back(look.record.status.name());
      } else {
        warnings.push_back(look.record.problem);
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

  test::ScratchDirectory directory;
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
  EXPECT_THAT(warnings,
              ElementsAre((directory / "served/a-backup.db").string() +
                          ": campaign a is in another file as well; move one of them away"));
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
  EXPECT_EQ(folder.open(campaign_of("a", 11), {}, {}, file).file, file);
  EXPECT_EQ(Store::open_read_only(file).num_runs(), 11U);
  EXPECT_FALSE(std::filesystem::exists(directory / "served/a.db"));
  std::filesystem::remove(file);
  EXPECT_THROW((void)folder.open(campaign_of("a", 11), {}, {}, file), StoreError);
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

TEST(CostEstimate, CountsAnIncompleteBatchAsAWhole) {
  const MicroscopeCampaign campaign;
  const std::uint64_t batch_size = model().batch_size();
  const std::uint64_t num_at_once = batch_size * wire::num_processors();
  EXPECT_EQ(estimated_cost(campaign, 1, 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(campaign, batch_size, 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(campaign, batch_size + 1, 2.5).one_core_s, 5.0);
  EXPECT_EQ(estimated_cost(campaign, 100 * batch_size, 2.5).one_core_s, 250.0);
  EXPECT_EQ(estimated_cost(campaign, num_at_once, 2.5).all_cores_s, 2.5);
  EXPECT_EQ(estimated_cost(campaign, num_at_once + 1, 2.5).all_cores_s, 5.0);
}

using Values = std::vector<std::string>;

TEST(SweepPlan, CutsValuesAtCommasOutsideOfBracketsAndQuotes) {
  EXPECT_EQ(parse_varied("noise.scale=0.5,1,2").key, "noise.scale");
  EXPECT_EQ(parse_varied("noise.scale=0.5, 1 ,2").values, (Values{"0.5", "1", "2"}));
  EXPECT_EQ(parse_varied("a=[1,2],[3,[4,5]]").values, (Values{"[1,2]", "[3,[4,5]]"}));
  EXPECT_EQ(parse_varied("a={x=1,y=2},3").values, (Values{"{x=1,y=2}", "3"}));
  EXPECT_EQ(parse_varied("a=\"b,\\\",c\",'d,e'").values, (Values{"\"b,\\\",c\"", "'d,e'"}));
}

// No value leaves the directory, and none takes the file of another.
TEST(SweepPlan, NamesNoFileOutsideOrTwice) {
  std::set<std::string> names;
  const Values values{
      "\"../x\"", "\".._x\"", "[1, 2]", "[1,2]", std::string(5000, '1'), std::string(5001, '1')};
  for (const std::string& value : values) {
    const std::string name = sweep_file_name("mine", {{"a", value}});
    EXPECT_EQ(name.find_first_of("/ []\""), std::string::npos) << name;
    EXPECT_LT(name.size(), 250U);
    EXPECT_TRUE(names.insert(name).second) << name;
  }
}

TEST(SweepPlan, CallsCampaignsByTheirValuesIfThatIsShort) {
  const std::vector<SweptValues> few{{{"noise.scale", "0.5"}}, {{"noise.scale", "1"}}};
  EXPECT_EQ(sweep_names(few).title, "noise.scale");
  EXPECT_EQ(sweep_names(few).names, (Values{"0.5", "1"}));
  const std::vector<SweptValues> wide{{{"environment.drag", "0.5"}}, {{"environment.drag", "1"}}};
  EXPECT_EQ(sweep_names(wide).names, (Values{"A", "B"}));
}

}  // namespace
}  // namespace proofmass::coordinator
