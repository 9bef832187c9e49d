#include "coordinator/report/sensitivity.hpp"

#include <nlohmann/json.hpp>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/report/text_lines.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// Every quantity uniform in [-1, 1]; the error of K2c is that with index 7, and that of a_c12 the
/// square of that with index 20.
DrawnRuns made_up_runs() {
  std::mt19937_64 bits(5);
  DrawnRuns drawn;
  drawn.names.assign(drawn_names().begin(), drawn_names().end());
  drawn.columns.resize(num_drawn);
  drawn.errors.resize(num_parameters);
  for (std::uint64_t run = 0; run < 1000; ++run) {
    drawn.runs.push_back({run});
    for (auto& column : drawn.columns) {
      column.push_back(static_cast<double>(bits() >> 11) * 0x1p-52 - 1.0);
    }
    for (auto& errors : drawn.errors) errors.push_back(1.0);
    drawn.errors[index(Parameter::k2c)].back() = drawn.columns[7].back();
    drawn.errors[index(Parameter::a_c12)].back() =
        drawn.columns[20].back() * drawn.columns[20].back();
  }
  drawn.num_with_estimate = drawn.num_first = drawn.runs.size();
  drawn.last_with_estimate = drawn.runs.back();
  return drawn;
}

TEST(SensitivityText, NamesTheQuantityThatDrivesAnError) {
  const auto lines = test::lines_of(sensitivity_text(made_up_runs(), index(Parameter::k2c), 2));
  ASSERT_EQ(lines.size(), 21U);
  EXPECT_EQ(lines[0], "K2c/K1c²: 1000 runs");
  EXPECT_THAT(lines[2], StartsWith("drives |error|"));
  EXPECT_THAT(lines[4], StartsWith(drawn_names()[7]));
  EXPECT_THAT(lines[7], StartsWith("drives error"));
  EXPECT_THAT(lines[9], StartsWith(drawn_names()[7]));
  EXPECT_THAT(lines[9], HasSubstr(" 100.0 (100.0, 100.0)    +1.00     <1e-09"));
}

// Of 59 quantities without influence none is called significant.
TEST(SensitivityText, CorrectsForAllQuantitiesTried) {
  const auto lines =
      test::lines_of(sensitivity_text(made_up_runs(), index(Parameter::k2c), num_drawn));
  const auto table = std::span(lines).subspan(4, num_drawn);
  EXPECT_THAT(table[0], EndsWith("  <1e-09"));
  for (const std::string& line : table.subspan(1)) {
    EXPECT_GT(std::stod(line.substr(line.rfind(' '))), 0.05) << line;
  }
}

// The error is that of other runs, so that no quantity has to do with it.
TEST(SensitivityText, SaysThatNoInputIsFoundAndListsSomeOnlyIfAsked) {
  DrawnRuns drawn = made_up_runs();
  std::vector<double>& errors = drawn.errors[index(Parameter::k2c)];
  std::ranges::rotate(errors, errors.begin() + 7);
  const std::string text = sensitivity_text(drawn, index(Parameter::k2c));
  EXPECT_THAT(text, HasSubstr("\n|error|: no input found "));
  EXPECT_THAT(text, HasSubstr("\nerror: no input found "));
  EXPECT_THAT(text, Not(HasSubstr("drives")));
  for (const std::string& name : drawn_names()) EXPECT_THAT(text, Not(HasSubstr("\n" + name)));
  EXPECT_THAT(sensitivity_text(drawn, index(Parameter::k2c), 2), HasSubstr("\ndrives |error| "));
  EXPECT_THAT(explanation_text(drawn, index(Parameter::k2c), {42}),
              HasSubstr("|error|: no input found "));
  EXPECT_THAT(sensitivity_text(made_up_runs(), index(Parameter::k2c)), HasSubstr("drives |error|"));
}

// Quantities 7 and 20 make no difference to the mean of the error, only together.
TEST(SensitivityText, NamesTheProductThatMakesAnError) {
  DrawnRuns drawn = made_up_runs();
  for (std::size_t i = 0; i < drawn.runs.size(); ++i) {
    drawn.errors[index(Parameter::k2c)][i] = -3.03 * drawn.columns[7][i] * drawn.columns[40][i];
  }
  const auto lines = test::lines_of(sensitivity_text(drawn, index(Parameter::k2c), 1));
  EXPECT_THAT(lines[12], StartsWith("error as a sum of "));
  EXPECT_EQ(lines[14], drawn_names()[7] + " × " + drawn_names()[40]);
  EXPECT_EQ(lines[15], std::string(51, ' ').append("-3.03      100.0 %     <1e-09"));
}

TEST(SensitivityText, NamesASquareAndSaysWhenNothingExplainsTheError) {
  const auto lines = test::lines_of(sensitivity_text(made_up_runs(), index(Parameter::a_c12), 1));
  EXPECT_THAT(lines[14], StartsWith("(" + drawn_names()[20] + ")²  "));
  EXPECT_THAT(lines[14], EndsWith(" 1      100.0 %     <1e-09"));
  EXPECT_THAT(sensitivity_text(made_up_runs(), index(Parameter::k2d), 1),
              HasSubstr("\n\nNo quantity and no product of two explains the error.\n"));
}

TEST(SensitivityText, SaysHowManyRunsItIsComputedFrom) {
  DrawnRuns drawn = made_up_runs();
  const std::string none = sensitivity_text(drawn, index(Parameter::k2c), 1);
  EXPECT_THAT(none, ::testing::Not(HasSubstr("Computed from")));
  drawn.num_with_estimate = 5000;
  EXPECT_THAT(sensitivity_text(drawn, index(Parameter::k2c), 1),
              StartsWith("K2c/K1c²: 1000 runs\nComputed from 1000 of 5000 runs with an estimate: "
                         "the first 1000\n\n"));
  drawn.num_first = 999;
  EXPECT_THAT(explanation_text(drawn, index(Parameter::k2c), {999}, 1),
              HasSubstr(" of 1000\nComputed from 1000 of 5000 runs with an estimate: the "
                        "first 999 and this one\n\n"))
      << "rank";
}

TEST(SensitivityText, CountsTheRunsThatItLeavesOut) {
  DrawnRuns drawn = made_up_runs();
  drawn.missing = {.num_not_finite = 2, .num_no_draw = 11, .num_given_up = 1};
  const std::string left_out =
      "\nLeft out, without an estimate: 2 not finite, 11 without draw, 1 given up\n\n";
  EXPECT_THAT(sensitivity_text(drawn, index(Parameter::k2c), 1),
              StartsWith("K2c/K1c²: 1000 runs" + left_out));
  EXPECT_THAT(explanation_text(drawn, index(Parameter::k2c), {42}, 1),
              HasSubstr(" of 1000" + left_out));
}

TEST(SensitivityText, FitsATerminal) {
  const DrawnRuns drawn = made_up_runs();
  EXPECT_THAT(test::lines_of(sensitivity_text(drawn, index(Parameter::k2c), num_drawn)),
              Each(test::FitsATerminal()));
  EXPECT_THAT(test::lines_of(explanation_text(drawn, index(Parameter::k2c), {3}, num_drawn)),
              Each(test::FitsATerminal()));
}

TEST(ExplanationText, ShowsTheRunsValuesOfWhatDrivesTheError) {
  DrawnRuns drawn = made_up_runs();
  drawn.columns[7][42] = 1.5;
  drawn.errors[index(Parameter::k2c)][42] = 1.5;
  const auto lines = test::lines_of(explanation_text(drawn, index(Parameter::k2c), {42}, 1));
  EXPECT_EQ(lines[0], "Run 42: error of K2c/K1c² 1.5 s²/m, rank 1 of 1000");
  EXPECT_THAT(lines[4], StartsWith(drawn_names()[7]));
  EXPECT_THAT(lines[4], HasSubstr("      1.5      99.9"));
}

// An error whose sign is that of one quantity and whose magnitude grows with another.
TEST(ExplanationText, ShowsWhatDrivesTheMagnitudeBeforeWhatDrivesTheError) {
  DrawnRuns drawn = made_up_runs();
  for (std::size_t i = 0; i < drawn.runs.size(); ++i) {
    drawn.errors[index(Parameter::k2c)][i] =
        std::copysign(2.0 + drawn.columns[20][i], drawn.columns[7][i]);
  }
  const auto lines = test::lines_of(explanation_text(drawn, index(Parameter::k2c), {42}, 1));
  EXPECT_THAT(lines[2], StartsWith("drives |error|"));
  EXPECT_THAT(lines[4], StartsWith(drawn_names()[20]));
  EXPECT_THAT(lines[6], StartsWith("drives error"));
  EXPECT_THAT(lines[8], StartsWith(drawn_names()[7]));
}

// k2c has the largest error and the highest rank; a_d12 the largest share of its objective.
TEST(ExplanationText, IsOfTheParameterThatIsWorstBesideItsObjective) {
  DrawnRuns drawn = made_up_runs();
  std::vector<double> objectives(num_parameters, 1.0);
  for (auto& errors : drawn.errors) errors[42] = 0.0;
  drawn.errors[index(Parameter::k2c)][42] = -9.0;
  objectives[index(Parameter::k2c)] = 90.0;
  drawn.errors[index(Parameter::a_d12)][42] = -0.25;
  objectives[index(Parameter::a_d12)] = 0.125;
  EXPECT_EQ(worst_quantity_of(drawn, {42}, objectives), index(Parameter::a_d12));
  EXPECT_EQ(choice_text(drawn, {42}, objectives),
            "Of a_d12, as its error is the largest beside its objective: 2 times that\n"
            "(another parameter: --parameter NAME)\n");
}

TEST(ExplanationText, IsOfTheHighestRankIfNothingHasAnObjective) {
  DrawnRuns drawn = made_up_runs();
  const std::vector<double> objectives(num_parameters, std::numeric_limits<double>::infinity());
  for (auto& errors : drawn.errors) errors[42] = 0.0;
  drawn.errors[index(Parameter::k2c)][42] = -9.0;
  EXPECT_EQ(worst_quantity_of(drawn, {42}, objectives), index(Parameter::k2c));
  EXPECT_EQ(choice_text(drawn, {42}, objectives),
            "Of k2c, no parameter having an objective: that of the highest rank\n");
}

TEST(SensitivityJson, HoldsWhatTheTablesHold) {
  DrawnRuns drawn = made_up_runs();
  drawn.columns[7][42] = 1.5;
  drawn.errors[index(Parameter::k2c)][42] = 1.5;
  const std::vector<std::size_t> quantities{index(Parameter::k2c)};
  const auto json = nlohmann::json::parse(sensitivity_json(drawn, quantities, RunIndex{42}, 2));
  EXPECT_EQ(json["run"], 42);
  EXPECT_EQ(json["num_runs"], 1000);
  ASSERT_EQ(json["parameters"].size(), 1U);
  const auto& parameter = json["parameters"][0];
  EXPECT_EQ(parameter["parameter"], "k2c");
  EXPECT_EQ(parameter["worst_run"], 42);
  EXPECT_EQ(parameter["run_error"], 1.5);
  EXPECT_EQ(parameter["run_rank"], 1);
  ASSERT_EQ(parameter["drives_error"].size(), 2U);
  const auto& driver = parameter["drives_error"][0];
  EXPECT_EQ(driver["quantity"], drawn_names()[7]);
  EXPECT_NEAR(driver["fraction_of_variance"], 1.0, 1e-3);
  EXPECT_EQ(driver["run_value"], 1.5);
  EXPECT_EQ(driver["run_percentile"], 99.9);  // 999 of 1000 runs are below.
  EXPECT_EQ(parameter["terms"][0]["quantity"], drawn_names()[7]);
  EXPECT_TRUE(parameter["terms"][0]["times"].is_null());
}

TEST(ExplanationText, RefusesARunBetweenThoseThatAreThere) {
  DrawnRuns drawn = made_up_runs();
  for (RunIndex& run : drawn.runs) run.value *= 2;
  drawn.last_with_estimate = drawn.runs.back();
  EXPECT_THROW((void)explanation_text(drawn, index(Parameter::k2c), {5}, 1), InvalidArgument);
}

using DrawnRunsTest = test::StoreTest;

// Run by run what the simulation draws, those that were rejected first included.
TEST_F(DrawnRunsTest, AreThoseOfTheSimulation) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.num_runs = 51;
  Store store = Store::create(file(), campaign, canonical_definition(campaign));
  std::vector<Delivery> deliveries = test::deliveries_of(0, 50);
  for (Delivery& delivery : deliveries) {
    delivery.result.num_draws = draw_instrument(campaign, delivery.result.run, {}).num_draws;
  }
  deliveries[4].result.status = RunStatus::not_finite;
  store.commit(deliveries);
  const Entry given_up = GivenUpRun{.run = {50}};
  store.write({&given_up, 1});

  const DrawnRuns drawn = read_drawn_runs(store, campaign, 40);

  ASSERT_EQ(drawn.runs.size(), 40U);
  EXPECT_EQ(drawn.missing, (MissingEstimates{.num_not_finite = 1, .num_given_up = 1}));
  EXPECT_EQ(drawn.names[num_drawn + 1], "truth_a_c11_delta_z_m");
  EXPECT_EQ(drawn.runs[4], RunIndex{5});
  for (std::size_t i = 0; i < drawn.runs.size(); ++i) {
    DrawnValues values{};
    for (std::size_t j = 0; j < num_drawn; ++j) values[j] = drawn.columns[j][i];
    EXPECT_EQ(drawn.columns[num_drawn + 1][i],
              test::result_of(drawn.runs[i].value).truth[index(Parameter::a_c11_delta_z)]);
    const Instrument instrument = *draw_instrument(campaign, drawn.runs[i], {}).instrument;
    EXPECT_EQ(sensitivity_matrices(make_instrument(values)).common,
              sensitivity_matrices(instrument).common);
  }
}

// No definition that was stored with these results rejects every draw.
TEST_F(DrawnRunsTest, AreRefusedIfTheDefinitionYieldsNone) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  Store::create(file(), campaign, canonical_definition(campaign)).commit(test::deliveries_of(0, 3));
  const Store store = Store::open_read_only(file());
  campaign.scenario.acceptance.a_d11_max = 1e-300;
  EXPECT_EQ(
      test::store_error_of([&] { (void)read_drawn_runs(store, campaign, 3); }),
      "campaign database = " + file().string() +
          " (is damaged: run 0 has an estimate, and its definition yields no draw; restore it "
          "from a copy)");
}

// Run 7 lies beyond the first four; run 4 has no estimate.
TEST_F(DrawnRunsTest, HoldARunBeyondTheFirst) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.num_runs = 10;
  Store store = Store::create(file(), campaign, canonical_definition(campaign));
  std::vector<Delivery> deliveries = test::deliveries_of(0, 10);
  for (Delivery& delivery : deliveries) {
    delivery.result.num_draws = draw_instrument(campaign, delivery.result.run, {}).num_draws;
  }
  deliveries[4].result.status = RunStatus::not_finite;
  store.commit(deliveries);
  const DrawnRuns drawn = read_drawn_runs(store, campaign, 3, RunIndex{7});
  EXPECT_EQ(drawn.runs, (std::vector<RunIndex>{{0}, {1}, {2}, {7}}));
  EXPECT_EQ(drawn.num_first, 3U);
  EXPECT_EQ(drawn.num_with_estimate, 9U);
  EXPECT_EQ(drawn.last_with_estimate, RunIndex{9});
  EXPECT_EQ(drawn.errors[0].size(), 4U);
  EXPECT_EQ(read_drawn_runs(store, campaign, 3, RunIndex{4}).runs.size(), 3U);
  EXPECT_EQ(read_drawn_runs(store, campaign, 3, RunIndex{1}).runs.size(), 3U);
}

}  // namespace
}  // namespace proofmass::coordinator
