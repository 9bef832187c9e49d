#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/override_options.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/report/digest.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

/// 60 runs whose errors of every parameter are 1, 2, ... 60 times 1e-6.
class ReportCommand : public testing::Test {
 protected:
  void SetUp() override { make(database_, 60); }

  static void make(const std::filesystem::path& database, std::uint64_t num_runs) {
    MicroscopeCampaign campaign = hardy2013_campaign();
    campaign.num_runs = num_runs;
    Store store = Store::create(database, campaign, canonical_definition(campaign));
    std::vector<Delivery> deliveries;
    for (std::uint64_t run = 0; run < campaign.num_runs; ++run) {
      Delivery delivery{.result = test::zero_result({.run = {run}, .num_draws = 1}),
                        .worker = {1},
                        .attempt = {1}};
      delivery.result.estimate.assign(num_parameters, 1e-6 * static_cast<double>(run + 1));
      deliveries.push_back(delivery);
    }
    store.commit(deliveries);
  }

  [[nodiscard]] int answer(const std::string& requirement) const {
    return test::answer_of({"report", database_, "--requirement", requirement}).exit_code;
  }

  test::TemporaryDirectory directory_;
  std::filesystem::path database_ = directory_ / "a.db";
};

TEST_F(ReportCommand, NeedsADatabase) {
  EXPECT_EQ(test::answer_of({"report", directory_ / "none.db"}).exit_code, exit_cannot_be_done);
}

// 59 runs below the limit show 95 % with 95 % [Wilks1941], and none is above 61e-6.
TEST_F(ReportCommand, TellsInItsExitCodeWhetherARequirementIsMet) {
  EXPECT_EQ(answer("a_c12 < 61e-6 for 95% with 95%"), exit_done);
  EXPECT_EQ(answer("a_c12 < 61e-6 for 99% with 95%"), exit_not_met);
  EXPECT_EQ(answer("a_c12 < 30e-6 for 95% with 95%"), exit_not_met);
}

TEST_F(ReportCommand, NeedsAllRequirementsMet) {
  EXPECT_EQ(test::answer_of({"report", database_, "--requirement", "a_c12 < 61e-6 for 95% with 95%",
                             "--requirement", "k2c < 61e-6 for 95% with 95%"})
                .exit_code,
            exit_done);
  EXPECT_EQ(test::answer_of({"report", database_, "--requirement", "a_c12 < 61e-6 for 95% with 95%",
                             "--requirement", "k2c < 30e-6 for 95% with 95%"})
                .exit_code,
            exit_not_met);
}

TEST_F(ReportCommand, RefusesARequirementThatCannotBeRead) {
  const test::Answer refused =
      test::answer_of({"report", database_, "--requirement", "a_c12 is small"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error,
            "requirement = a_c12 is small (must read \"PARAMETER < LIMIT for COVERAGE% with "
            "CONFIDENCE%\" or \"all objectives for COVERAGE% with CONFIDENCE%\")");
}

TEST_F(ReportCommand, ShowsARequirementThatCanBeRead) {
  EXPECT_EQ(example_requirement(), "a_c13 < 0.0009 for 99% with 95%");
  EXPECT_EQ(answer(example_requirement()), exit_not_met);  // 60 runs are too few.
  EXPECT_THAT(test::answer_of({"report", "--help"}).output,
              testing::HasSubstr('"' + example_requirement() + '"'));
}

TEST_F(ReportCommand, RefusesAnUnknownParameter) {
  const test::Answer refused = test::answer_of({"sensitivity", database_, "--parameter", "k2e"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error,
            "parameter = k2e (must be one of a_c11_delta_x a_c11_delta_z a_c11_delta_y a_c12 "
            "a_c13 a_d11_prime a_d12 a_d13 k2d k2c)");
}

// A campaign as it is, not a wrong question; with one run more there is an answer.
TEST_F(ReportCommand, SaysWhenRunsAreTooFewForSensitivities) {
  const auto few = directory_ / "few.db", enough = directory_ / "enough.db";
  make(few, 15);
  make(enough, 16);
  const test::Answer refused = test::answer_of({"sensitivity", few});
  EXPECT_EQ(refused.exit_code, exit_cannot_be_done);
  EXPECT_EQ(refused.error, "runs with an estimate = 15 (sensitivities need 16 at least)");
  EXPECT_EQ(test::answer_of({"sensitivity", enough, "--parameter", "k2c"}).exit_code, exit_done);
}

TEST_F(ReportCommand, RefusesARunWithoutAnEstimate) {
  const test::Answer refused = test::answer_of({"sensitivity", database_, "--run", "60"});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "run = 60 (must have an estimate, as 60 runs up to 59 have)");
}

TEST_F(ReportCommand, ChoosesTheParameterOfARunByItsObjective) {
  const std::string output = test::answer_of({"sensitivity", database_, "--run", "9"}).output;
  EXPECT_TRUE(output.starts_with("Of a_c11_delta_")) << output;
  const test::Answer of_one =
      test::answer_of({"sensitivity", database_, "--run", "9", "--parameter", "k2c"});
  EXPECT_TRUE(of_one.output.starts_with("Run 9: error of K2c/K1c² 1e-05 ")) << of_one.output;
}

TEST_F(ReportCommand, SaysThatDatabaseAndQuestionAreSwapped) {
  const test::Answer refused = test::answer_of({"query", "SELECT 1", database_});
  EXPECT_EQ(refused.exit_code, exit_wrong_usage);
  EXPECT_EQ(refused.error, "SQL = " + database_.string() +
                               " (is a database: the database goes before the question)");
}

// Errors 1, 2, ... 60 times 1e-6: their mean is 30.5e-6, their variance that of 60 numbers in a
// row, 60·61/12, and 1 − 30/60 of them are above 30e-6.
TEST_F(ReportCommand, PrintsWhatTheTablesHoldAsJson) {
  const test::Answer answer = test::answer_of(
      {"report", database_, "--json", "--requirement", "a_c12 < 30.5e-6 for 95% with 95%"});
  EXPECT_EQ(answer.exit_code, exit_not_met);
  const auto json = nlohmann::json::parse(answer.output);
  EXPECT_EQ(json["num_runs"], 60);
  EXPECT_EQ(json["num_finished"], 60);
  EXPECT_EQ(json["num_with_estimate"], 60);
  EXPECT_EQ(json["num_lost"], 0);
  EXPECT_EQ(json["digest"], digest_of(Store::open_read_only(database_)));
  EXPECT_EQ(json["is_digest_checked"], false);  // No statistics are stored.
  ASSERT_EQ(json["parameters"].size(), num_parameters);
  const auto& parameter = json["parameters"][index(Parameter::a_c12)];
  EXPECT_EQ(parameter["parameter"], "a_c12");
  EXPECT_EQ(parameter["unit"], "rad");
  EXPECT_EQ(parameter["objective"], hardy2013_campaign().objectives()[index(Parameter::a_c12)]);
  EXPECT_EQ(parameter["worst"], 1e-6 * 60.0);
  EXPECT_EQ(parameter["worst_run"], 59);
  EXPECT_DOUBLE_EQ(parameter["mean"], 30.5e-6);
  EXPECT_DOUBLE_EQ(parameter["standard_deviation"], 1e-6 * std::sqrt(60.0 * 61.0 / 12.0));
  EXPECT_DOUBLE_EQ(parameter["bias"], 30.5e-6);
  EXPECT_LT(parameter["bias_interval"][0], 30.5e-6);
  EXPECT_GT(parameter["bias_interval"][1], 30.5e-6);
  EXPECT_EQ(parameter["percentiles"][0]["level"], 0.5);
  EXPECT_TRUE(parameter["percentiles"][3]["interval"].is_null());  // Needs 368 runs.
  EXPECT_EQ(json["budget"]["terms"].size(), hardy2013_campaign().error_budget()->terms.size());
  EXPECT_EQ(json["budget"]["total"]["before_m_s2"],
            hardy2013_campaign().error_budget()->before(0.0).total);
  const auto& requirement = json["requirements"][0];
  EXPECT_EQ(requirement["answer"], "not met");
  EXPECT_EQ(requirement["num_exceedances"], 30);
  EXPECT_EQ(requirement["limit"], 30.5e-6);
}

TEST_F(ReportCommand, PrintsNullWhereNoRunHasAnEstimate) {
  const auto none = directory_ / "none.db";
  const MicroscopeCampaign campaign = hardy2013_campaign();
  (void)Store::create(none, campaign, canonical_definition(campaign));
  const auto json = nlohmann::json::parse(test::answer_of({"report", none, "--json"}).output);
  EXPECT_TRUE(json["parameters"][0]["mean"].is_null());
  EXPECT_TRUE(json["parameters"][0]["fraction_beyond_objective"].is_null());
  EXPECT_TRUE(json["budget"]["total"]["after_mean_m_s2"].is_null());
  EXPECT_TRUE(json["all_objectives"]["fraction_within_interval"].is_null());
}

// The results are made up: a simulation yields others.
TEST_F(ReportCommand, VerifiesWithJsonForPrograms) {
  const test::Answer answer = test::answer_of({"verify", database_, "--json"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  const auto json = nlohmann::json::parse(answer.output);
  EXPECT_EQ(json["file"], database_.string());
  ASSERT_EQ(json["checks"].size(), 11U);
  EXPECT_EQ(json["checks"][0]["name"], "file");
  EXPECT_EQ(json["checks"][0]["verdict"], "ok");
  const auto& last = json["checks"][10];
  EXPECT_EQ(last["name"], "simulation");
  EXPECT_EQ(last["verdict"], "FAILS");
  EXPECT_FALSE(last["details"].empty());
  const auto num_failing = std::ranges::count_if(
      json["checks"], [](const auto& check) { return check["verdict"] == "FAILS"; });
  EXPECT_EQ(json["num_failing"], num_failing);
}

}  // namespace
}  // namespace proofmass::coordinator
