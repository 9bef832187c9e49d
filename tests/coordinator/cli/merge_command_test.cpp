// `proofmass run --range` as far as it reads its arguments, and `proofmass merge`: parts of a
// campaign make the whole, and nothing else is taken for a part.

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "coordinator/report/digest.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/cli/program.hpp"

namespace proofmass::coordinator {
namespace {

using test::Answer;
using test::answer_of;
using ::testing::HasSubstr;

constexpr std::uint64_t num_runs = 24;

class MergeCommand : public test::StoreTest {
 protected:
  static void SetUpTestSuite() { results() = test::simulated(test::quick_campaign(num_runs)); }
  static std::vector<RunResult>& results() {
    static std::vector<RunResult> of_campaign;
    return of_campaign;
  }

  [[nodiscard]] std::string path(const std::string& name) const { return directory() / name; }

  /// A database of the campaign with the results of the runs [first, end).
  Store part(const std::string& name, std::uint64_t first, std::uint64_t end) const {
    const auto begin = results().begin();
    return test::store_of(
        path(name), test::quick_campaign(num_runs),
        {begin + static_cast<std::ptrdiff_t>(first), begin + static_cast<std::ptrdiff_t>(end)});
  }

  [[nodiscard]] Answer merge(const std::vector<std::string>& parts,
                             const std::vector<std::string>& further = {}) const {
    std::vector<std::string> arguments{"merge", path("whole.db")};
    for (const std::string& name : parts) arguments.push_back(path(name));
    arguments.insert(arguments.end(), further.begin(), further.end());
    return answer_of(std::move(arguments));
  }

  [[nodiscard]] std::string digest_of_whole() const {
    return digest_of(Store::open_read_only(path("whole.db")));
  }
};

TEST_F(MergeCommand, PrintsJson) {
  (void)part("a.db", 0, 10);
  (void)part("b.db", 8, 20);
  const Answer answer = merge({"a.db", "b.db"}, {"--json"});
  ASSERT_EQ(answer.exit_code, exit_done) << answer.error;
  const auto json = nlohmann::json::parse(answer.output);
  EXPECT_EQ(json["file"], path("whole.db"));
  EXPECT_EQ(json["parts"][0],
            (nlohmann::json{{"file", path("a.db")}, {"num_new", 10}, {"num_again", 0}}));
  EXPECT_EQ(json["parts"][1],
            (nlohmann::json{{"file", path("b.db")}, {"num_new", 10}, {"num_again", 2}}));
  EXPECT_EQ(json["num_runs"], num_runs);
  EXPECT_EQ(json["num_missing"], 4);
  EXPECT_EQ(json["missing"], (nlohmann::json::array({{{"first_run", 20}, {"num_runs", 4}}})));
  EXPECT_EQ(json["digest"], digest_of_whole());
}

TEST_F(MergeCommand, GivesTheDigestOfTheCampaignInAnyOrderOfTheParts) {
  const std::string expected = digest_of(part("undivided.db", 0, num_runs));
  (void)part("a.db", 0, 2);
  (void)part("b.db", 2, 19);
  (void)part("c.db", 19, num_runs);
  std::vector<std::string> parts{"a.db", "b.db", "c.db"};
  do {
    const Answer answer = merge(parts);
    EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
    EXPECT_THAT(answer.output, HasSubstr("b.db: 17 runs\n"));
    EXPECT_TRUE(answer.output.ends_with("\nDigest " + expected + "\n")) << answer.output;
    EXPECT_EQ(digest_of_whole(), expected);
    std::filesystem::remove(path("whole.db"));
  } while (std::ranges::next_permutation(parts).found);
}

TEST_F(MergeCommand, LeavesADatabaseThatHoldsAllChecks) {
  (void)part("a.db", 0, 20);
  (void)part("b.db", 10, num_runs);
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_THAT(answer.output, HasSubstr("b.db: 4 runs, and 10 equal to those of parts before it\n"));
  EXPECT_EQ(answer_of({"verify", path("whole.db")}).exit_code, exit_done);
}

TEST_F(MergeCommand, NamesTheRunsThatAreInNoPart) {
  (void)part("a.db", 0, 10);
  (void)part("b.db", 15, 20);
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_THAT(answer.output, HasSubstr("9 of 24 runs are in no part: 10..14,20..23\n"));
  EXPECT_EQ(Store::open_read_only(path("whole.db")).control().phase, wire::CampaignPhase::active);
}

TEST_F(MergeCommand, TakesAPartWithoutResults) {
  (void)part("a.db", 0, 0);
  const Answer answer = merge({"a.db"});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_THAT(answer.output, HasSubstr("24 of 24 runs are in no part: 0..23\n"));
}

TEST_F(MergeCommand, RefusesAnotherCampaignAndNamesTheDifferences) {
  (void)part("a.db", 0, 10);
  MicroscopeCampaign other = test::quick_campaign(num_runs);
  other.seed = 5;
  other.scenario.noise.scale = 0.5;
  (void)test::store_of(path("b.db"), other, {});
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_THAT(answer.error, HasSubstr("b.db holds another campaign:\n"));
  EXPECT_THAT(answer.error, HasSubstr("seed: 5 in the database, 1 asked for"));
  EXPECT_THAT(answer.error, HasSubstr("noise.scale: 0.5 in the database, 1 asked for"));
  EXPECT_FALSE(std::filesystem::exists(path("whole.db")));
}

// A campaign that was extended after a part of it was computed is the same one.
TEST_F(MergeCommand, TakesPartsOfACampaignThatWasExtended) {
  (void)test::store_of(path("a.db"), test::quick_campaign(10),
                       {results().begin(), results().begin() + 10});
  (void)part("b.db", 10, num_runs);
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_EQ(digest_of_whole(), digest_of(part("undivided.db", 0, num_runs)));
}

TEST_F(MergeCommand, RefusesAPartWithAStopRule) {
  (void)part("a.db", 0, 10);
  part("b.db", 10, 20)
      .set_stop_plan({.stop_rule = "std(a_c13) within 5%", .num_runs_max = 24, .failures_max = {}});
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_THAT(answer.error, HasSubstr("b.db has until = std(a_c13) within 5% (must not be"));
}

// The digest of the results that is stored with the statistics tells.
TEST_F(MergeCommand, RefusesAPartWhoseResultsWereChanged) {
  (void)part("a.db", 0, 10);
  {
    Store store = part("b.db", 10, num_runs);
    update_statistics(store, test::quick_campaign(num_runs));
  }
  test::change(path("b.db"), "UPDATE run_result SET estimate_k2d_s2_m = 1.0 WHERE run_index = 12");
  const Answer answer = merge({"a.db", "b.db"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_THAT(answer.error, HasSubstr("b.db fails these checks:\n"));
  EXPECT_THAT(answer.error, HasSubstr("digest"));
  EXPECT_FALSE(std::filesystem::exists(path("whole.db")));
}

// Nothing in the file contradicts it: the draws made again, or the runs simulated again, do.
TEST_F(MergeCommand, RefusesAPartThatWasForgedThroughout) {
  (void)part("a.db", 0, 10);
  std::vector<RunResult> forged(results().begin() + 10, results().end());
  forged[3].estimate[0] *= 1.0 + 1e-6;
  (void)test::store_of(path("b.db"), test::quick_campaign(num_runs), forged);
  const Answer of_estimate = merge({"a.db", "b.db"}, {"--fraction", "1"});
  EXPECT_EQ(of_estimate.exit_code, exit_cannot_be_done);
  EXPECT_THAT(of_estimate.error, HasSubstr("simulation  FAILS"));

  forged[3] = results()[13];
  forged[3].truth[0] *= 1.0 + 1e-6;
  (void)test::store_of(path("c.db"), test::quick_campaign(num_runs), forged);
  const Answer of_truth = merge({"a.db", "c.db"}, {"--fraction", "0"});
  EXPECT_EQ(of_truth.exit_code, exit_cannot_be_done);
  EXPECT_THAT(of_truth.error, HasSubstr("draws       FAILS"));
}

TEST_F(MergeCommand, RefusesToReplaceAFile) {
  (void)part("a.db", 0, 10);
  (void)part("whole.db", 0, 10);
  const Answer answer = merge({"a.db"});
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_EQ(answer.error, "output = " + path("whole.db") + " (exists already)");
}

// Said before the parts are checked, which may take long: this one is not even there.
TEST_F(MergeCommand, NeedsADirectoryForTheFile) {
  const std::string whole = directory() / "none" / "whole.db";
  const Answer answer = answer_of({"merge", whole, path("a.db")});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "output = " + whole + " (its directory does not exist)");
}

class RangeOption : public test::StoreTest {
 protected:
  [[nodiscard]] Answer answer(const std::string& range,
                              const std::vector<std::string>& further = {}) const {
    const std::string file = directory() / "a.toml";
    test::write_file(file, "[campaign]\nname = \"a\"\nruns = 20\n");
    std::vector<std::string> arguments{"run", file, "--db", directory() / "a.db", "--range", range};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return answer_of(std::move(arguments));
  }
};

TEST_F(RangeOption, TakesTwoNumbersInOrder) {
  for (const std::string range : {"5", "5:", ":5", "5:5", "9:5", "-1:5", "1:5x", "1.5:3", "1:2:3",
                                  "99999999999999999999:5", ""}) {
    const Answer refused = answer(range);
    EXPECT_EQ(refused.exit_code, exit_wrong_usage) << range;
    EXPECT_EQ(refused.error, "--range = " + range + " (must be A:B, whole numbers with A below B)");
  }
}

TEST_F(RangeOption, EndsWithTheCampaign) {
  const Answer refused = answer("10:21");
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "range = 10:21 (must end at most at campaign.runs = 20)");
  EXPECT_FALSE(std::filesystem::exists(directory() / "a.db"));
}

TEST_F(RangeOption, GoesWithNoStopRule) {
  const Answer refused = answer("10:20", {"--until", "std(a_c13) within 5%"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "range = 10:20 (must not be with --until)");
}

}  // namespace
}  // namespace proofmass::coordinator
