#include "coordinator/archive/replay.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>

#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/coordinator/archive/series_reading.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// The cells of a line of CSV in which nothing is quoted.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char character : line) {
    if (character == ',') {
      cells.emplace_back();
    } else {
      cells.back() += character;
    }
  }
  return cells;
}

/// The number that a cell is; anything else fails the test.
double number(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  EXPECT_TRUE(error == std::errc() && end == text.data() + text.size()) << text;
  return value;
}

class ReplayTest : public test::StoreTest {
 protected:
  [[nodiscard]] std::filesystem::path output() const { return directory() / "run.h5"; }

  /// A file with all runs of a campaign, which another kernel than that of a replay has simulated.
  Store store_with(const MicroscopeCampaign& campaign) {
    return test::store_of(file(), campaign, test::simulated(campaign));
  }
  /// Replays a run into output(); some sessions and groups, or all.
  std::vector<ResultDifference> replay(const Store& store, std::uint64_t run,
                                       const std::vector<std::string>& sessions = {},
                                       const std::vector<std::string>& groups = {}) {
    const Replay replay(store);
    const SignalSelection selection(replay.recording(), sessions, groups);
    const RunResult stored = replay.stored_result(RunIndex{run});
    const auto series = hdf5_series(
        output(), {.store = store, .result = stored, .program_version = "1.2.3"}, selection);
    return replay.run(stored, series.get(), test::never_stopped);
  }
  void expect_no_output() const {
    EXPECT_THAT(file_names(), Each(Not(HasSubstr("run"))));
    EXPECT_THAT(file_names(), Each(Not(EndsWith(".new"))));
  }
};

TEST_F(ReplayTest, IsOfRunsThatHaveAResult) {
  const MicroscopeCampaign campaign = test::quick_campaign(9);
  Store store = test::store_of(file(), campaign, {test::result_of(2)});
  const Entry entry = GivenUpRun{RunIndex{5}};
  (void)store.write({&entry, 1});
  const Replay again(store);
  EXPECT_EQ(again.stored_result(RunIndex{2}).run, RunIndex{2});
  EXPECT_EQ(test::error_of([&] { (void)again.stored_result(RunIndex{5}); }),
            "run = 5 (has no result: it was given up after it had crashed workers)");
}

TEST_F(ReplayTest, SaysWhatItsFileHolds) {
  const Store store = store_with(test::quick_campaign(2));
  EXPECT_THAT(replay(store, 1), IsEmpty());
  const auto read = test::description_of_series(output());
  const auto& root = read["attributes"];
  EXPECT_EQ(root["name"], "hardy2013");
  EXPECT_EQ(root["seed"], 1);
  EXPECT_EQ(root["run_index"], 1);
  EXPECT_EQ(root["status"], "completed");
  EXPECT_EQ(root["model_version"], store.model_version());
  EXPECT_EQ(root["program_version"], "1.2.3");
  EXPECT_EQ(root["definition"], store.definition());
  EXPECT_EQ(root["frame_names"], nlohmann::json({"I", "R", "S", "K1", "K2"}));
  EXPECT_EQ(read["sessions"].size(), 11U);
  const auto& session = read["sessions"]["a_c13"];
  EXPECT_EQ(session["attributes"]["session"], "a_c13");
  EXPECT_EQ(session["attributes"]["sample_rate_hz"], 1.0);
  EXPECT_EQ(session["datasets"].size(), 9U);
  for (const auto& [name, dataset] : session["datasets"].items()) {
    const std::size_t num_fields = dataset["fields"].size();
    EXPECT_EQ(dataset["shape"], nlohmann::json({29750})) << name;  // Five orbits of 5950 s at 1 Hz.
    EXPECT_EQ(dataset["fields"][0], "time");
    EXPECT_EQ(dataset["types"], nlohmann::json({"float64"}));
    EXPECT_EQ(dataset["units"][0], "s");
    for (const char* key : {"units", "frames", "meanings"}) {
      EXPECT_EQ(dataset[key].size(), num_fields) << name << " " << key;
    }
  }
  const auto& measured = session["datasets"]["measured"];
  EXPECT_EQ(measured["fields"][4], "mass_2_K_x");
  EXPECT_EQ(measured["units"][4], "m/s²");
  EXPECT_EQ(measured["frames"][4], "K2");
}

// Samples are flushed in blocks: the last one of a session is not full.
TEST_F(ReplayTest, HasEachTimeOfASession) {
  const Store store = store_with(test::quick_campaign(1));
  EXPECT_THAT(replay(store, 0, {"k2d"}, {"thrust"}), IsEmpty());
  const std::vector<double> times = test::series_in(output(), "k2d/thrust", "time");
  ASSERT_EQ(times.size(), 29750U);
  for (std::size_t k = 0; k < times.size(); ++k) ASSERT_EQ(times[k], static_cast<double>(k));
}

TEST_F(ReplayTest, WritesWhatIsSelected) {
  const Store store = store_with(test::quick_campaign(1));
  EXPECT_THAT(replay(store, 0, {"a_d12", "a_c13"}, {"modes"}), IsEmpty());
  const auto read = test::description_of_series(output());
  EXPECT_EQ(read["sessions"].size(), 2U);
  EXPECT_EQ(read["sessions"]["a_d12"]["datasets"].size(), 1U);
  const std::vector<double> alone = test::series_in(output(), "a_c13/modes", "common_z");
  EXPECT_THAT(replay(store, 0), IsEmpty());
  EXPECT_EQ(test::series_in(output(), "a_c13/modes", "common_z"), alone);
}

TEST_F(ReplayTest, WritesTheSameBitsAsCsv) {
  const Store store = store_with(test::quick_campaign(1));
  EXPECT_THAT(replay(store, 0, {"a_c13"}, {"modes", "measured"}), IsEmpty());
  const Replay again(store);
  const std::vector<std::string> sessions{"a_c13"}, groups{"modes", "measured"};
  const SignalSelection selection(again.recording(), sessions, groups);
  const RunResult stored = again.stored_result(RunIndex{0});
  const auto series = csv_series(directory(), RunIndex{0}, selection);
  EXPECT_THAT(again.run(stored, series.get(), test::never_stopped), IsEmpty());
  std::istringstream csv(test::content_of(directory() / "run0_a_c13.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line,
            "time {s},measured.mass_1_K_x {m/s2},measured.mass_1_K_y {m/s2},measured.mass_1_K_z "
            "{m/s2},measured.mass_2_K_x {m/s2},measured.mass_2_K_y {m/s2},measured.mass_2_K_z "
            "{m/s2},modes.differential_x {m/s2},modes.common_x {m/s2},modes.common_y "
            "{m/s2},modes.common_z {m/s2}\r");
  const std::vector<double> expected = test::series_in(output(), "a_c13/modes", "differential_x");
  std::size_t num_rows = 0;
  for (; std::getline(csv, line); ++num_rows) {
    line.pop_back();
    const std::vector<std::string> cells = cells_of(line);
    ASSERT_EQ(cells.size(), 11U);
    ASSERT_EQ(number(cells[0]), static_cast<double>(num_rows));
    ASSERT_EQ(test::bits_of(number(cells[7])), test::bits_of(expected.at(num_rows)));
  }
  EXPECT_EQ(num_rows, expected.size());
}

// That of a run that is lost is what one wants to see.
TEST_F(ReplayTest, ShowsALostRun) {
  MicroscopeCampaign campaign = test::quick_campaign(1);
  campaign.scenario.sensor.range_m_s2 = 2e-8;
  const Store store = store_with(campaign);
  const Replay again(store);
  ASSERT_EQ(again.stored_result(RunIndex{0}).status, RunStatus::lost);
  EXPECT_THAT(replay(store, 0, {"a_d11_prime"}, {"measured"}), IsEmpty());
  const auto root = test::description_of_series(output())["attributes"];
  EXPECT_EQ(root["status"], "lost");
  EXPECT_EQ(root["loss_cause"], "saturation");
  const std::vector<double> x = test::series_in(output(), "a_d11_prime/measured", "mass_1_K_x");
  EXPECT_EQ(*std::ranges::max_element(x), 2e-8);
  EXPECT_EQ(*std::ranges::min_element(x), -2e-8);
}

/// A result whose only error is that of a parameter, in units of its objective.
RunResult result_with(std::uint64_t run, Parameter parameter, double ratio) {
  RunResult result = test::result_of(run);
  result.estimate = result.truth;
  const std::size_t i = index(parameter);
  result.truth[i] = 0.0;
  result.estimate[i] = ratio * MicroscopeCampaign().scenario.objectives[i];
  return result;
}

TEST_F(ReplayTest, FindsTheWorstRuns) {
  std::vector<RunResult> results{
      result_with(0, Parameter::k2c, 0.5), result_with(1, Parameter::a_c13, -2.0),
      result_with(2, Parameter::k2d, 2.0), test::result_of(3, RunStatus::not_finite),
      result_with(4, Parameter::a_d12, 3.0)};
  const Store store = test::store_of(file(), test::quick_campaign(5), results);
  const Replay again(store);
  const auto worst = [&](std::size_t count) {
    std::vector<std::uint64_t> runs;
    for (const RunResult& result : again.worst_results(count, test::never_stopped)) {
      runs.push_back(result.run.value);
    }
    return runs;
  };
  EXPECT_THAT(worst(1), ElementsAre(4));
  EXPECT_THAT(worst(2), ElementsAre(4, 1));  // Of equal ones the first.
  EXPECT_THAT(worst(3), ElementsAre(4, 1, 2));
  EXPECT_THAT(worst(9), ElementsAre(4, 1, 2, 0));
}

}  // namespace
}  // namespace proofmass::coordinator
