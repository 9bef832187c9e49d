#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "coordinator/cli/program.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

class Check : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path write(const std::string& text) const {
    std::ofstream(directory_ / "a.toml") << text;
    return directory_ / "a.toml";
  }

  const test::TemporaryDirectory directory_;
};

TEST_F(Check, SaysThatTheFileOfInitChangesNothing) {
  const auto file = directory_ / "a.toml";
  (void)test::answer_of({"init", file});
  const test::Answer answer = test::answer_of({"check", file});
  EXPECT_EQ(answer.exit_code, exit_done);
  EXPECT_EQ(answer.output,
            file.string() +
                " is valid\n"
                "Campaign  hardy2013, seed 1\n"
                "Runs      100 of 140 orbits\n\n"
                "Beside the number of runs, nothing differs from what `proofmass init` writes.\n");
}

TEST_F(Check, ShowsWhatAFileAndTheOptionsChange) {
  const auto file = write("campaign = { name = \"mine\", runs = 7 }\nnoise.scale = 0\n");
  const test::Answer answer = test::answer_of({"check", file, "--seed", "3"});
  EXPECT_EQ(answer.exit_code, exit_done);
  EXPECT_EQ(answer.output,
            file.string() +
                " is valid\n"
                "Campaign  mine, seed 3\n"
                "Runs      7 of 140 orbits\n\n"
                "Beside the number of runs, these differ from what `proofmass init` writes:\n"
                "  name = \"mine\" (instead of \"hardy2013\")\n"
                "  seed = 3 (instead of 1)\n"
                "  noise.scale = 0 (instead of 1)\n"
                "  estimation.correction = \"second_order\" (instead of \"hardy2013\")\n");
}

TEST_F(Check, CountsTheNumberOfRunsAsNoDifference) {
  const auto file = directory_ / "a.toml";
  (void)test::answer_of({"init", file});
  const std::string output = test::answer_of({"check", file, "--runs", "7"}).output;
  EXPECT_NE(output.find("Runs      7 of 140 orbits\n\nBeside the number of runs, nothing differs"),
            std::string::npos)
      << output;
}

TEST_F(Check, RefusesWhatRunWouldRefuse) {
  const auto file = write("campaign.name = \"mine\"\nnoise.scale = -1\n");
  const test::Answer answer = test::answer_of({"check", file});
  EXPECT_EQ(answer.exit_code, exit_wrong_usage);
  EXPECT_EQ(answer.error, file.string() + ":2: noise.scale = -1 (must be >= 0)");
  EXPECT_EQ(answer.output, "");
}

}  // namespace
}  // namespace proofmass::coordinator
