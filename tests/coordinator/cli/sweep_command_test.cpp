#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "coordinator/cli/sweep_plan.hpp"

namespace proofmass::coordinator {
namespace {

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
  EXPECT_EQ(sweep_names(wide).notes[1], "environment.drag=1: ");
}

}  // namespace
}  // namespace proofmass::coordinator
