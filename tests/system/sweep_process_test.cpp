// `proofmass sweep` with real workers, undisturbed and interrupted. Each of its campaigns must be
// the one that `proofmass run --set` makes.

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

using Json = nlohmann::json;

class SweepProcess : public CampaignProcess {
 protected:
  /// The output of `proofmass` with these arguments, which ends with 0.
  [[nodiscard]] std::string output_of(const std::string& name, const Arguments& arguments) const {
    EXPECT_EQ(Process(directory / "", name, programs + "/proofmass", arguments).wait(), 0)
        << errors_of(name);
    return read_file(path(name + ".out"));
  }
  [[nodiscard]] Json json_of(const std::string& name, Arguments arguments) const {
    arguments.emplace_back("--json");
    return Json::parse(output_of(name, arguments));
  }
  [[nodiscard]] std::string file_of(const std::string& value) const {
    return "short-sweep/short-noise.scale=" + value + ".db";
  }

  const Arguments sweep{"sweep",  "short.toml", "--vary",    "noise.scale=1,0.5,2",
                        "--runs", "64",         "--workers", "2"};
};

TEST_F(SweepProcess, RunsTheCampaignOfEachValue) {
  const Json json = json_of("sweep", sweep);
  ASSERT_EQ(json["campaigns"].size(), 3U);
  for (const Json& campaign : json["campaigns"]) {
    const std::string value = campaign["varied"]["noise.scale"];
    const Json own = json_of("own", {"run", "short.toml", "--runs", "64", "--set",
                                     "noise.scale=" + value, "--db", "own" + value + ".db"});
    EXPECT_EQ(campaign["file"], file_of(value));
    EXPECT_EQ(campaign["digest"], own["digest"]) << value;
    EXPECT_EQ(own, json_of("report", {"report", file_of(value)})) << "run --json";
    for (std::size_t i = 0; i < own["parameters"].size(); ++i) {
      for (const std::string key :
           {"parameter", "unit", "worst", "mean", "standard_deviation", "num_beyond_objective"}) {
        EXPECT_EQ(campaign["parameters"][i][key], own["parameters"][i][key]) << value << key;
      }
    }
  }
  EXPECT_TRUE(contains(errors_of("sweep"), "proofmass: 3 campaigns in short-sweep, 3 of them un"))
      << errors_of("sweep");
  EXPECT_TRUE(contains(errors_of("sweep"), "\nTime      about ")) << errors_of("sweep");
  EXPECT_TRUE(contains(errors_of("sweep"), "proofmass: campaign 3 of 3: noise.scale=2\n"));
}

TEST_F(SweepProcess, PrintsTheTablesOfCompareWithItsValues) {
  const std::string swept = output_of("sweep", sweep);
  const std::string compared =
      output_of("compare", {"compare", file_of("1"), file_of("0.5"), file_of("2")});
  EXPECT_TRUE(contains(swept, "\nnoise.scale ")) << swept;
  EXPECT_TRUE(contains(swept, "\n  run by run, 64 runs of the same draws: 0.5 2\n")) << swept;
  EXPECT_TRUE(contains(compared, "\n  run by run, 64 runs of the same draws: B C\n")) << compared;
  // The rows of the first campaign have the same figures.
  const auto row = [](const std::string& text, const std::string& name) {
    const std::size_t begin = text.find("\n" + name);
    const std::string line = text.substr(begin + 1, text.find('\n', begin + 1) - begin - 1);
    return line.substr(name.size());
  };
  EXPECT_EQ(row(swept, "0.5             "), row(compared, "B               "));
}

TEST_F(SweepProcess, GoesOnAfterAnInterruptAndLeavesWhatIsFinished) {
  Arguments arguments = sweep;
  arguments[5] = "320";
  {
    Process interrupted(directory / "", "first", programs + "/proofmass", arguments);
    wait_until("runs of the second campaign", [&] {
      return std::filesystem::exists(path(file_of("0.5"))) && num_stored(path(file_of("0.5"))) > 0;
    });
    interrupted.signal(SIGINT);
    EXPECT_EQ(interrupted.wait(), 130) << errors_of("first");
  }
  EXPECT_TRUE(contains(errors_of("first"), "proofmass: the same command continues the sweep\n"))
      << errors_of("first");
  EXPECT_EQ(read_file(path("first.out")), "");
  EXPECT_FALSE(std::filesystem::exists(path(file_of("2"))));
  const std::string finished = read_file(path(file_of("1")));
  (void)output_of("second", arguments);
  EXPECT_TRUE(read_file(path(file_of("1"))) == finished) << "was changed";
  for (const std::string value : {"1", "0.5", "2"}) {
    EXPECT_EQ(num_stored(path(file_of(value))), 320U) << value;
  }
  EXPECT_TRUE(contains(errors_of("second"), "3 campaigns in short-sweep, 2 of them unfinished"))
      << errors_of("second");
}

TEST_F(SweepProcess, EndsAsTheGravestOfItsCampaigns) {
  Arguments arguments = sweep;
  arguments.insert(arguments.end(), {"--until", "std(a_c13) within 0.1%"});
  Process missed(directory / "", "missed", programs + "/proofmass", arguments);
  EXPECT_EQ(missed.wait(), 3) << errors_of("missed");
  EXPECT_TRUE(contains(read_file(path("missed.out")), "\nnoise.scale ")) << "with its tables";
  Process again(directory / "", "again", programs + "/proofmass", arguments);
  EXPECT_EQ(again.wait(), 3) << errors_of("again");
  EXPECT_TRUE(contains(errors_of("again"), "3 campaigns in short-sweep, 0 of them unfinished"))
      << errors_of("again");
}

}  // namespace
}  // namespace proofmass::test
