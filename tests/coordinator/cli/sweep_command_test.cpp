#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "coordinator/cli/sweep_plan.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

using test::message_of;
using Values = std::vector<std::string>;

TEST(SweepPlan, CutsValuesAtCommasOutsideOfBracketsAndQuotes) {
  EXPECT_EQ(parse_varied("noise.scale=0.5,1,2").key, "noise.scale");
  EXPECT_EQ(parse_varied("noise.scale=0.5, 1 ,2").values, (Values{"0.5", "1", "2"}));
  EXPECT_EQ(parse_varied("a=[1,2],[3,[4,5]]").values, (Values{"[1,2]", "[3,[4,5]]"}));
  EXPECT_EQ(parse_varied("a={x=1,y=2},3").values, (Values{"{x=1,y=2}", "3"}));
  EXPECT_EQ(parse_varied("a=\"b,\\\",c\",'d,e'").values, (Values{"\"b,\\\",c\"", "'d,e'"}));
}

TEST(SweepPlan, RefusesWhatIsNoListOfDifferentValues) {
  const auto refusal = [](const std::string& text) {
    return message_of<UsageError>([&] { (void)parse_varied(text); });
  };
  for (const std::string text : {"", "noise.scale", "=1,2", "noise.scale=", "noise.scale=1,,2"}) {
    EXPECT_EQ(refusal(text), "vary = " + text + " (must be KEY=VALUE,VALUE,...)");
  }
  EXPECT_EQ(refusal("noise.scale=1,2,1"), "vary = noise.scale=1,2,1 (has the value 1 twice)");
}

TEST(SweepPlan, CombinesAllValuesWithTheLastKeyFastest) {
  const std::vector<VariedKey> keys{{"a", {"1", "2"}}, {"b", {"x", "y"}}};
  Values texts;
  for (const SweptValues& values : combinations(keys)) texts.push_back(text_of(values));
  EXPECT_EQ(texts, (Values{"a=1,b=x", "a=1,b=y", "a=2,b=x", "a=2,b=y"}));
}

TEST(SweepPlan, HasTwoToAThousandCampaigns) {
  const auto refusal = [](const std::vector<VariedKey>& keys) {
    return message_of<UsageError>([&] { (void)combinations(keys); });
  };
  Values many;
  for (int i = 0; i < 1000; ++i) many.push_back(std::to_string(i));
  const std::vector<VariedKey> most{{"a", many}};
  EXPECT_EQ(combinations(most).size(), 1000U);
  EXPECT_EQ(refusal({{"a", many}, {"b", {"1", "2"}}}), "vary = b (makes more than 1000 campaigns)");
  EXPECT_EQ(refusal({{"a", {"1"}}}), "vary = (must make at least two campaigns)");
  EXPECT_EQ(refusal({{"a", {"1"}}, {"a", {"2"}}}), "vary = a (is given twice)");
}

TEST(SweepPlan, NamesFilesByTheirValues) {
  EXPECT_EQ(sweep_file_name("mine", {{"noise.scale", "0.5"}, {"a.b", "1e-3"}}),
            "mine-noise.scale=0.5,a.b=1e-3.db");
  EXPECT_EQ(sweep_file_name("mine", {{"a", "\"x\""}}), "mine-a=x.db");
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
  EXPECT_EQ(sweep_names(wide).notes[1], "environment.drag=1: ");
}

/// A sweep that is refused before anything is made.
class SweepRefusal : public testing::Test {
 protected:
  SweepRefusal() { std::ofstream(file_) << "campaign = { name = \"mine\", runs = 7 }\n"; }

  [[nodiscard]] std::string refusal(std::vector<std::string> further) const {
    std::vector<std::string> arguments{"sweep", file_, "--directory", sweep_};
    arguments.insert(arguments.end(), further.begin(), further.end());
    const test::Answer answer = test::answer_of(arguments);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    EXPECT_EQ(answer.output, "");
    return answer.error;
  }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_ / "mine.toml";
  const std::filesystem::path sweep_ = directory_ / "sweep";
};

TEST_F(SweepRefusal, ComesBeforeAnythingIsMade) {
  EXPECT_EQ(refusal({"--vary", "noise.scal=1,2"}),
            "--vary noise.scal=1: unknown key; nearest is noise.scale");
  EXPECT_EQ(refusal({"--vary", "noise.scale=1,-1"}), "--vary noise.scale=-1: must be >= 0");
  EXPECT_EQ(refusal({"--vary", "noise.scale=1,1.0"}),
            "vary = noise.scale=1.0 (makes the same campaign as noise.scale=1)");
  EXPECT_EQ(refusal({"--vary", "noise.scale=1,2", "--set", "noise.scale=3"}),
            "--vary noise.scale=1: noise.scale is set more than once");
  EXPECT_FALSE(std::filesystem::exists(sweep_));
}

TEST_F(SweepRefusal, IsOfADatabaseThatHoldsAnotherCampaign) {
  std::filesystem::create_directory(sweep_);
  const std::filesystem::path taken = sweep_ / "mine-noise.scale=2.db";
  const MicroscopeCampaign campaign = hardy2013_campaign();
  (void)Store::create(taken, campaign, canonical_definition(campaign));
  const std::string error = refusal({"--vary", "noise.scale=1,2"});
  EXPECT_TRUE(error.starts_with(taken.string() + " holds another campaign:")) << error;
  EXPECT_TRUE(error.ends_with("name another directory with --directory")) << error;
  EXPECT_FALSE(std::filesystem::exists(sweep_ / "mine-noise.scale=1.db"));
}

TEST_F(SweepRefusal, IsOfAFileInThePlaceOfTheDirectory) {
  std::ofstream(sweep_) << "mine";
  const test::Answer answer = test::answer_of(
      {"sweep", file_, "--directory", sweep_, "--vary", "noise.scale=1,2", "--quiet"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "directory = " + sweep_.string() + " (Not a directory)");
}

}  // namespace
}  // namespace proofmass::coordinator
