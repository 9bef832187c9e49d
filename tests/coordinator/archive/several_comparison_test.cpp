#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/statistics/error_change.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

bool never_stopped() { return false; }

/// Databases of campaigns whose errors of parameter i are ±scale·(i + 1)·(run + 1)·1e-9, by turns.
class SeveralComparison : public testing::Test {
 protected:
  void write(const std::string& name, double scale, std::uint64_t seed = 1,
             std::uint64_t num_finished = 40) {
    MicroscopeCampaign campaign = test::campaign_of(40);
    campaign.seed = seed;
    campaign.scenario.noise.scale = scale;
    std::vector<RunResult> results;
    for (std::uint64_t run = 0; run < num_finished; ++run) {
      RunResult result = test::zero_result({.run = {run}, .num_draws = 1, .num_rounds = 2});
      for (std::size_t i = 0; i < num_parameters; ++i) {
        const double error = 1e-9 * scale * static_cast<double>((i + 1) * (run + 1));
        result.estimate[i] = run % 2 == 0 ? error : -error;
      }
      results.push_back(result);
    }
    files_.push_back(directory_ / name);
    (void)test::store_of(files_.back(), campaign, results);
  }

  [[nodiscard]] std::vector<ComparedMember> compared() const {
    return compare_several(files_, never_stopped);
  }

  const test::TemporaryDirectory directory_;
  std::vector<std::filesystem::path> files_;
};

// Of 40 runs the worst error is 40, the mean 20.5 and the standard deviation √(40·41/12), all times
// scale·(i + 1)·1e-9.
TEST_F(SeveralComparison, HasTheStatisticsOfAllRunsOfEach) {
  const std::vector<double> scales{1.0, 2.0, 0.5};
  for (const double scale : scales) write("scale" + std::to_string(scale) + ".db", scale);
  const std::vector<ComparedMember> members = compared();
  ASSERT_EQ(members.size(), 3U);
  for (std::size_t member = 0; member < 3; ++member) {
    EXPECT_EQ(members[member].statistics.num_estimated, 40U);
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double unit = 1e-9 * scales[member] * static_cast<double>(i + 1);
      const AccuracyStatistic& accuracy = members[member].statistics.accuracy[i];
      EXPECT_NEAR(accuracy.worst / unit, 40.0, 1e-12);
      EXPECT_NEAR(accuracy.mean / unit, 20.5, 1e-12);
      EXPECT_NEAR(accuracy.standard_deviation / unit, std::sqrt(40.0 * 41.0 / 12.0), 1e-12);
    }
  }
  EXPECT_FALSE(members[0].comparison.has_value());
  ASSERT_TRUE(members[1].comparison.has_value());
  EXPECT_TRUE(members[1].comparison->is_paired());
}

// Holm's method over both comparisons: the smallest of their 2·30 p-values is multiplied by the
// weights of all, 2·10 (of 0.5, 0.4 and 0.1 for each parameter), over its own, 0.4.
TEST_F(SeveralComparison, CorrectsForAllCampaignsTogether) {
  write("a.db", 1.0);
  write("b.db", 1.0);
  write("c.db", 3.0);
  const std::vector<ComparedMember> members = compared();
  double smallest = 1.0;
  for (const ParameterComparison& parameter : members[2].comparison->parameters) {
    smallest = std::min(smallest, parameter.p_values.scale);
  }
  ASSERT_LT(smallest, 1e-6);
  for (const ParameterComparison& parameter : members[2].comparison->parameters) {
    if (parameter.p_values.scale != smallest) continue;
    EXPECT_NEAR(parameter.adjusted_p_values.scale / smallest, 50.0, 1e-9);
  }
  for (const ParameterComparison& parameter : members[1].comparison->parameters) {
    EXPECT_EQ(parameter.adjusted_p_values.scale, 1.0);
  }
}

TEST_F(SeveralComparison, MarksWhatIsSignificantlyDifferentFromTheFirst) {
  write("a.db", 1.0);
  write("b.db", 1.0);
  write("c.db", 3.0);
  const std::string text = comparison_text(compared(), lettered(3));
  std::istringstream stream(text);
  std::size_t num_rows = 0;
  for (std::string line; std::getline(stream, line);) {
    const bool names_a_file = line.find(".db") != line.npos || line.find("─  ─") != line.npos;
    EXPECT_TRUE(names_a_file || display_width(line) <= 80U) << line;
    const std::string blanks(19, ' ');
    if (line.starts_with(blanks + "B ")) {
      EXPECT_THAT(line, Not(HasSubstr("*")));
    }
    if (line.starts_with(blanks + "C ") && line.find(" *") != std::string::npos) ++num_rows;
  }
  EXPECT_EQ(num_rows, num_parameters) << "whose scatter differs";
}

TEST_F(SeveralComparison, SaysWhichCampaignCannotBeCompared) {
  write("a.db", 1.0);
  write("b.db", 2.0);
  write("empty.db", 1.0, 1, 0);
  const std::vector<ComparedMember> members = compared();
  const std::string text = comparison_text(members, lettered(3));
  EXPECT_THAT(text,
              HasSubstr("     0  cannot be: 40 and 0 runs with an estimate (must be at least"));
  const Json json = Json::parse(comparison_json(members));
  const Json& empty = json["campaigns"][2]["parameters"][0];
  EXPECT_TRUE(empty["worst"].is_null());
  EXPECT_TRUE(json["campaigns"][2]["comparison"]["parameters"].empty());
}

TEST_F(SeveralComparison, IsCompleteAsJson) {
  write("a.db", 1.0);
  write("b.db", 2.0);
  write("c.db", 0.5);
  const std::vector<std::vector<KeyText>> varied{
      {{"noise.scale", "1"}}, {{"noise.scale", "2"}}, {{"noise.scale", "0.5"}}};
  const Json json = Json::parse(comparison_json(compared(), varied));
  ASSERT_EQ(json["campaigns"].size(), 3U);
  const Json& second = json["campaigns"][1];
  EXPECT_EQ(second["varied"]["noise.scale"], "2");
  EXPECT_EQ(second["file"], files_[1].string());
  EXPECT_EQ(second["num_with_estimate"], 40);
  EXPECT_EQ(second["digest"].get<std::string>().size(), 64U);
  EXPECT_EQ(second["parameters"].size(), num_parameters);
  EXPECT_EQ(second["comparison"]["first"], files_[0].string());
  EXPECT_EQ(second["comparison"]["differences"][0]["field"], "noise.scale");
  EXPECT_TRUE(json["campaigns"][0]["comparison"].is_null());
}

TEST(Letters, GoOnWithTwoAfterZ) {
  const MemberNames names = lettered(703);
  EXPECT_EQ(names.names[0], "A");
  EXPECT_EQ(names.names[25], "Z");
  EXPECT_EQ(names.names[26], "AA");
  EXPECT_EQ(names.names[701], "ZZ");
  EXPECT_EQ(names.names[702], "AAA");
}

}  // namespace
}  // namespace proofmass::coordinator
