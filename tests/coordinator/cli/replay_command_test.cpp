#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

using Arguments = std::vector<std::string>;

/// A database with three runs; that of run 2 has an estimate that is off by its last bit.
class ReplayCommand : public testing::Test {
 protected:
  ReplayCommand() {
    const MicroscopeCampaign campaign = test::quick_campaign(4);
    std::vector<RunResult> results = test::simulated(campaign);
    results.pop_back();
    results[2].estimate[0] = std::nextafter(results[2].estimate[0], 1.0);
    (void)test::store_of(database_, campaign, results);
  }

  [[nodiscard]] test::Answer replay(const Arguments& further) const {
    Arguments arguments{"replay", database_, "--session", "a_c13", "--group", "modes"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return test::answer_of(arguments);
  }
  [[nodiscard]] std::string printed_by(const Arguments& further) const {
    const test::Answer answer = replay(further);
    EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
    return answer.output;
  }
  [[nodiscard]] std::string misuse(const Arguments& further) const {
    const test::Answer answer = replay(further);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    return answer.error;
  }
  [[nodiscard]] std::set<std::string> names_in(const std::filesystem::path& directory) const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(directory)) {
      names.insert(entry.path().filename());
    }
    return names;
  }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path database_ = directory_ / "a.db";
};

TEST_F(ReplayCommand, SaysThatTheRunIsTheStoredOne) {
  EXPECT_EQ(printed_by({"--run", "1"}), "run 1 completed: all values equal the stored ones\n");
  EXPECT_EQ(names_in(directory_ / ""), std::set<std::string>{"a.db"});
}

TEST_F(ReplayCommand, WritesAFile) {
  const std::string output = directory_ / "run1.h5";
  EXPECT_EQ(printed_by({"--run", "1", "--output", output}),
            "run 1 completed: all values equal the stored ones\nwrote " + output + "\n");
  EXPECT_EQ(test::content_of(output).substr(1, 3), "HDF");
}

TEST_F(ReplayCommand, EndsWithOneIfABitDiffers) {
  const test::Answer answer = replay({"--run", "2", "--output", directory_ / "run2.h5"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.output.find("run 2 estimate_a_c11_delta_x_m: stored "), 0U) << answer.output;
  EXPECT_EQ(answer.error, "run 2: 1 of its values is not the stored one");
  EXPECT_EQ(names_in(directory_ / ""), std::set<std::string>{"a.db"});
}

TEST_F(ReplayCommand, PrintsJson) {
  using Json = nlohmann::json;
  const std::string output = directory_ / "run1.h5";
  EXPECT_EQ(Json::parse(printed_by({"--run", "1", "--output", output, "--json"})),
            (Json{{"runs", Json::array({{{"run", 1},
                                         {"status", "completed"},
                                         {"is_equal", true},
                                         {"differences", Json::array()},
                                         {"files", {output}}}})}}));
  const test::Answer answer = replay({"--run", "2", "--json"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  const Json run = Json::parse(answer.output)["runs"][0];
  EXPECT_EQ(run["is_equal"], false);
  EXPECT_EQ(run["differences"][0]["column"], "estimate_a_c11_delta_x_m");
  EXPECT_NE(run["differences"][0]["stored"], run["differences"][0]["now"]);
}

TEST_F(ReplayCommand, WritesACsvFileForEachSession) {
  const auto output = directory_ / "csv";
  EXPECT_EQ(printed_by({"--run", "0", "--session", "k2d", "--format", "csv", "--output", output}),
            "run 0 completed: all values equal the stored ones\nwrote " +
                (output / "run0_a_c13.csv").string() + "\nwrote " +
                (output / "run0_k2d.csv").string() + "\n");
  EXPECT_EQ(names_in(output), (std::set<std::string>{"run0_a_c13.csv", "run0_k2d.csv"}));
}

// The run whose bits differ is among the three; what was written before it stays.
TEST_F(ReplayCommand, WritesTheWorstRuns) {
  const auto output = directory_ / "worst";
  const test::Answer answer = replay({"--worst", "100", "--output", output});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  const std::set<std::string> written = names_in(output);
  EXPECT_FALSE(written.contains("run2.h5"));
  EXPECT_LE(written.size(), 2U);
  const std::string one = printed_by({"--worst", "1", "--output", directory_ / "one"});
  EXPECT_EQ(names_in(directory_ / "one").size(), 1U) << one;
}

TEST_F(ReplayCommand, WritesOverNoFileUnlessForced) {
  const auto output = directory_ / "run1.h5";
  std::ofstream(output) << "mine";
  const Arguments arguments{"--run", "1", "--output", output};
  EXPECT_EQ(misuse(arguments),
            "output = " + output.string() + " (exists already; replace it with --force)");
  EXPECT_EQ(std::filesystem::file_size(output), 4U);
  EXPECT_NE(printed_by({"--run", "1", "--output", output, "--force"}), "");
  EXPECT_GT(std::filesystem::file_size(output), 4U);
  EXPECT_EQ(misuse({"--run", "1", "--output", database_, "--force"}),
            "output = " + database_.string() + " (is a campaign, which --force does not replace)");
  EXPECT_EQ(
      misuse({"--run", "1", "--output", directory_ / "", "--force"}),
      "output = " + (directory_ / "").string() + " (is no file; series are written to files)");
}

// No file of several is written if one of them exists.
TEST_F(ReplayCommand, LooksForAllFilesBeforeItSimulates) {
  const auto output = directory_ / "csv";
  std::filesystem::create_directory(output);
  std::ofstream(output / "run0_k2d.csv") << "mine";
  EXPECT_EQ(misuse({"--run", "0", "--session", "k2d", "--format", "csv", "--output", output}),
            "output = " + (output / "run0_k2d.csv").string() +
                " (exists already; replace it with --force)");
  EXPECT_EQ(names_in(output), std::set<std::string>{"run0_k2d.csv"});
}

TEST_F(ReplayCommand, NeedsADirectoryForSeveralFiles) {
  for (const Arguments& several : {Arguments{"--worst", "1"}, {"--run", "0", "--format", "csv"}}) {
    Arguments arguments = several;
    arguments.insert(arguments.end(), {"--output", database_});
    EXPECT_EQ(misuse(arguments),
              "output = " + database_.string() + " (must be a directory for csv and --worst)");
    arguments.back() = directory_ / "no" / "where";
    const test::Answer answer = replay(arguments);
    EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
    EXPECT_EQ(answer.error, "output = " + (directory_ / "no" / "where").string() +
                                " (cannot be made: No such file or directory)");
  }
}

// The directory that it made goes again.
TEST_F(ReplayCommand, LeavesNoEmptyDirectory) {
  const test::Answer answer =
      replay({"--run", "2", "--format", "csv", "--output", directory_ / "csv"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(names_in(directory_ / ""), std::set<std::string>{"a.db"});
}

TEST_F(ReplayCommand, IsToldWhichRuns) {
  EXPECT_EQ(misuse({}), "run = (must be given, or --worst)");
  EXPECT_EQ(misuse({"--run", "1", "--worst", "2"}), "worst = 2 (must not be given with --run)");
  EXPECT_EQ(misuse({"--run", "4"}), "run = 4 (must be below 4, the number of runs)");
  EXPECT_EQ(misuse({"--run", "-1"}), "--run = -1 (must be a whole number in [0, 999999999])");
  EXPECT_EQ(misuse({"--worst", "0"}), "--worst = 0 (must be in [1, 1000])");
  EXPECT_EQ(misuse({"--run", "0", "--group", "fuel"}).find("group = fuel (must be one of "), 0U);
  const test::Answer answer = replay({"--run", "3"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "run = 3 (has no result yet)");
}

}  // namespace
}  // namespace proofmass::coordinator
