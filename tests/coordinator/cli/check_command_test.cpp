#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "coordinator/cli/cost_estimate.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/results/results.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

/// The text with `...` in place of the estimates, which depend on the machine.
std::string without_figures(const std::string& text) {
  const std::regex time(
      "about ([0-9]+ [a-z]+ ?)+ of one core; ([0-9]+ [a-z]+ ?)+ on the [0-9]+ cores here\n");
  return std::regex_replace(std::regex_replace(text, time, "...\n"),
                            std::regex("about [0-9]+\\.[0-9] MB\n"), "...\n");
}

double disk_mb_in(const std::string& text) {
  return std::stod(text.substr(text.find("Disk      about ") + 16));
}

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
  EXPECT_EQ(without_figures(answer.output),
            file.string() +
                " is valid\n"
                "Campaign  hardy2013, seed 1\n"
                "Runs      100 of 140 orbits\n"
                "Time      ...\n"
                "Disk      ...\n\n"
                "Beside the number of runs, nothing differs from what `proofmass init` writes.\n");
}

TEST_F(Check, ShowsWhatAFileAndTheOptionsChange) {
  const auto file = write("campaign = { name = \"mine\", runs = 7 }\nnoise.scale = 0\n");
  const test::Answer answer = test::answer_of({"check", file, "--seed", "3"});
  EXPECT_EQ(answer.exit_code, exit_done);
  EXPECT_EQ(without_figures(answer.output),
            file.string() +
                " is valid\n"
                "Campaign  mine, seed 3\n"
                "Runs      7 of 140 orbits\n"
                "Time      ...\n"
                "Disk      ...\n\n"
                "Beside the number of runs, these differ from what `proofmass init` writes:\n"
                "  name = \"mine\" (instead of \"hardy2013\")\n"
                "  seed = 3 (instead of 1)\n"
                "  noise.scale = 0 (instead of 1)\n");
}

TEST_F(Check, PrintsJson) {
  const auto file = write("campaign = { name = \"mine\", runs = 7 }\nnoise.scale = 0\n");
  const auto json = nlohmann::json::parse(test::answer_of({"check", file, "--json"}).output);
  EXPECT_EQ(json["file"], file.string());
  EXPECT_EQ(json["campaign"], "mine");
  EXPECT_EQ(json["seed"], "1");
  EXPECT_EQ(json["num_runs"], 7);
  EXPECT_EQ(json["num_steps"], 140);
  EXPECT_EQ(json["step_name"], "orbits");
  EXPECT_GT(json["one_core_s"], 0.0);
  EXPECT_EQ(json["all_cores_s"], json["one_core_s"]) << "one batch";
  EXPECT_GE(json["num_cores"], 1);
  EXPECT_GT(json["disk_bytes"], 170e3);
  const nlohmann::json noise{{"field", "noise.scale"}, {"value", "0"}, {"example", "1"}};
  EXPECT_EQ(json["differences"][1], noise);
}

TEST_F(Check, CountsTheNumberOfRunsAsNoDifference) {
  const auto file = directory_ / "a.toml";
  (void)test::answer_of({"init", file});
  const std::string output = test::answer_of({"check", file, "--runs", "7"}).output;
  EXPECT_NE(output.find("Runs      7 of 140 orbits\n"), std::string::npos) << output;
  EXPECT_NE(output.find("\n\nBeside the number of runs, nothing differs"), std::string::npos)
      << output;
}

/// Runs of a full batch.
std::uint64_t batch_size() { return model().batch_size(); }

// Three batches one after another on one core, side by side on all.
TEST_F(Check, EstimatesTheTimeOfAllRuns) {
  const auto file = write("campaign.name = \"mine\"\n");
  const std::string num_runs = std::to_string(3 * batch_size());
  const auto json =
      nlohmann::json::parse(test::answer_of({"check", file, "--runs", num_runs, "--json"}).output);
  const auto num_cores = json["num_cores"].get<std::uint64_t>();
  const std::uint64_t num_rounds = (3 + num_cores - 1) / num_cores;
  EXPECT_DOUBLE_EQ(json["one_core_s"].get<double>() / json["all_cores_s"].get<double>(),
                   3.0 / static_cast<double>(num_rounds));
}

TEST(CostEstimate, CountsAnIncompleteBatchAsAWhole) {
  const std::uint64_t num_at_once = batch_size() * wire::num_processors();
  EXPECT_EQ(estimated_cost(1, 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(batch_size(), 2.5).one_core_s, 2.5);
  EXPECT_EQ(estimated_cost(batch_size() + 1, 2.5).one_core_s, 5.0);
  EXPECT_EQ(estimated_cost(100 * batch_size(), 2.5).one_core_s, 250.0);
  EXPECT_EQ(estimated_cost(num_at_once, 2.5).all_cores_s, 2.5);
  EXPECT_EQ(estimated_cost(num_at_once + 1, 2.5).all_cores_s, 5.0);
}

TEST(CostEstimate, FitsATerminalOf80Columns) {
  constexpr double long_s = 99 * 86400.0 + 23 * 3600.0;
  std::istringstream lines(
      cost_text({.one_core_s = long_s, .all_cores_s = long_s, .disk_mb = 290000.5}));
  for (std::string line; std::getline(lines, line);) EXPECT_LT(line.size(), 80U) << line;
}

TEST_F(Check, EstimatesTheDiskThatADatabaseTakes) {
  constexpr std::uint64_t num_runs = 5000;
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.num_runs = num_runs;
  {
    Store store = Store::create(directory_ / "a.db", campaign, canonical_definition(campaign));
    std::vector<Delivery> deliveries;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      Delivery delivery{.result = test::zero_result({.run = {run}, .num_draws = 1}),
                        .worker = {1},
                        .attempt = {1}};
      // SQLite stores numbers like 0 in fewer bytes.
      delivery.result.truth.assign(num_parameters, 1e-7 / static_cast<double>(run + 3));
      delivery.result.estimate.assign(num_parameters, 1.1e-7 / static_cast<double>(run + 3));
      delivery.result.health.assign(num_health_values, 1e-9 / static_cast<double>(run + 3));
      deliveries.push_back(delivery);
    }
    store.commit(deliveries);
    (void)store.rest();
  }
  const double size_mb =
      1e-6 * static_cast<double>(std::filesystem::file_size(directory_ / "a.db"));
  const auto file = write("campaign.name = \"mine\"\n");
  const std::string output =
      test::answer_of({"check", file, "--runs", std::to_string(num_runs)}).output;
  EXPECT_NEAR(disk_mb_in(output) / size_mb, 1.0, 0.15) << output << size_mb;
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
