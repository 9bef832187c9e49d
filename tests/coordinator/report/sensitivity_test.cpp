#include "coordinator/report/sensitivity.hpp"

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// Every quantity uniform in [-1, 1]; the error of K2c is that with index 7.
DrawnRuns made_up_runs() {
  std::mt19937_64 bits(5);
  DrawnRuns drawn;
  drawn.names.assign(drawn_names().begin(), drawn_names().end());
  drawn.quantities = test::schema().quantities;
  drawn.columns.resize(num_drawn);
  drawn.errors.resize(num_parameters);
  for (std::uint64_t run = 0; run < 1000; ++run) {
    drawn.runs.push_back({run});
    for (auto& column : drawn.columns) {
      column.push_back(static_cast<double>(bits() >> 11) * 0x1p-52 - 1.0);
    }
    for (auto& errors : drawn.errors) errors.push_back(1.0);
    drawn.errors[index(Parameter::k2c)].back() = drawn.columns[7].back();
  }
  drawn.num_with_estimate = drawn.num_first = drawn.runs.size();
  drawn.last_with_estimate = drawn.runs.back();
  return drawn;
}

TEST(SensitivityText, SaysHowManyRunsItIsComputedFrom) {
  DrawnRuns drawn = made_up_runs();
  const std::string none = sensitivity_text(drawn, index(Parameter::k2c), {}, 1);
  EXPECT_THAT(none, Not(HasSubstr("Computed from")));
  drawn.num_with_estimate = 5000;
  EXPECT_THAT(sensitivity_text(drawn, index(Parameter::k2c), {}, 1),
              StartsWith("K2c/K1c²: 1000 runs\nComputed from 1000 of 5000 runs with an estimate: "
                         "the first 1000\n\n"));
  drawn.num_first = 999;
  EXPECT_THAT(sensitivity_text(drawn, index(Parameter::k2c), RunIndex{999}, 1),
              HasSubstr(" of 1000\nComputed from 1000 of 5000 runs with an estimate: the "
                        "first 999 and this one\n\n"))
      << "rank";
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

TEST(ExplanationText, RefusesARunBetweenThoseThatAreThere) {
  DrawnRuns drawn = made_up_runs();
  for (RunIndex& run : drawn.runs) run.value *= 2;
  drawn.last_with_estimate = drawn.runs.back();
  EXPECT_THROW((void)sensitivity_text(drawn, index(Parameter::k2c), RunIndex{5}, 1),
               InvalidArgument);
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
