#include "coordinator/store/store.hpp"

#include "coordinator/store/detail/database.hpp"
#include "core/campaign/dispersion.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using detail::Statement;
using test::result_of;
using test::session_1;

using StoreTest = test::StoreTest;

/// Asserts that two results are the same bits, of which they have no spare ones.
void expect_same_bits(const RunResult& left, const RunResult& right) {
  EXPECT_EQ(left.run, right.run);
  EXPECT_EQ(left.status, right.status);
  EXPECT_EQ(left.num_draws, right.num_draws);
  EXPECT_EQ(left.num_rounds, right.num_rounds);
  const auto bits_of = [](const std::vector<double>& values) {
    std::vector<std::uint64_t> bits;
    for (const double value : values) bits.push_back(std::bit_cast<std::uint64_t>(value));
    return bits;
  };
  EXPECT_EQ(bits_of(left.truth), bits_of(right.truth));
  EXPECT_EQ(bits_of(left.estimate), bits_of(right.estimate));
}

/// A campaign with two rows of environment and two drawn quantities from tables.
MicroscopeCampaign campaign_with_data(std::uint64_t num_runs) {
  MicroscopeCampaign campaign = campaign_of(num_runs);
  campaign.environment_table = {
      {.time_s = -0.1, .linear_m_s2 = {1e-7, 1.0 / 3.0, 0.0}, .angular_rad_s2 = {1, -2, 3e-300}},
      {.time_s = 6000.0, .linear_m_s2 = {0.1, 0.2, 0.3}, .angular_rad_s2 = {0, 0, 1e-9}}};
  for (const std::size_t element : {std::size_t{3}, std::size_t{17}}) {
    campaign.dispersions[element].law = Law::table;
    std::vector<double> column(num_runs + 1);  // Files may hold more values than there are runs.
    for (std::size_t run = 0; run < column.size(); ++run) {
      column[run] = static_cast<double>(element) + static_cast<double>(run) / 7.0;
    }
    campaign.table_columns.push_back(column);
  }
  return campaign;
}

TEST_F(StoreTest, HoldsTheCampaignThatItWasCreatedWith) {
  MicroscopeCampaign campaign = campaign_with_data(3);
  campaign.name = "naïve";
  campaign.seed = std::numeric_limits<std::uint64_t>::max();
  Store::create(file(), campaign, "name = \"naïve\"\n");

  const Store store = Store::open(file());
  EXPECT_EQ(store.name(), "naïve");
  EXPECT_EQ(store.seed(), 18446744073709551615u);
  EXPECT_EQ(store.num_runs(), 3u);
  EXPECT_EQ(store.definition(), "name = \"naïve\"\n");
}

// Campaigns are served in the order in which they were made, also those of one second.
TEST_F(StoreTest, KnowsWhenItWasMadeToAMillisecond) {
  Store::create(file(), campaign_of(1), "");
  EXPECT_THAT(Store::open(file()).created_utc(),
              testing::ContainsRegex("^20..-..-..T..:..:..[.][0-9][0-9][0-9]Z$"));
}

TEST_F(StoreTest, HoldsTheDataOfItsCampaign) {
  Store::create(file(), campaign_with_data(3), "");
  const Database database(file(), Access::read_only);
  Statement row = database.prepare("SELECT * FROM environment_row ORDER BY position");
  ASSERT_TRUE(row.step());
  EXPECT_EQ(row.real(1), -0.1);
  EXPECT_EQ(row.real(3), 1.0 / 3.0);
  EXPECT_EQ(row.real(7), 3e-300);
  ASSERT_TRUE(row.step());
  EXPECT_EQ(row.real(1), 6000.0);
  EXPECT_FALSE(row.step());
  Statement value = database.prepare("SELECT value FROM dispersion_value ORDER BY value");
  for (const double element : {3.0, 17.0}) {
    for (const double run : {0.0, 1.0, 2.0}) {
      ASSERT_TRUE(value.step());
      EXPECT_EQ(value.real(0), element + run / 7.0);
    }
  }
  EXPECT_FALSE(value.step());
}

TEST_F(StoreTest, ReturnsResultsBitForBit) {
  RunResult extremes = result_of(0);
  extremes.truth = {0.1,
                    -1.0 / 3.0,
                    std::numeric_limits<double>::denorm_min(),
                    magnitude_max,
                    1e-300,
                    3.0,
                    1e15,
                    9007199254740993.0,
                    -5e-324,
                    std::numeric_limits<double>::epsilon()};
  extremes.num_draws = std::numeric_limits<std::uint32_t>::max();
  const std::vector<Delivery> deliveries{{extremes, session_1, {1}, 1.0},
                                         {result_of(1), session_1, {1}, 1.0}};
  create(2).commit(deliveries);

  const std::vector<RunResult> results = results_in(Store::open(file()));
  ASSERT_EQ(results.size(), 2u);
  expect_same_bits(results[0], extremes);
  expect_same_bits(results[1], result_of(1));
}

TEST_F(StoreTest, KeepsNoSignOfAZero) {
  Delivery delivery = delivery_of(0);
  delivery.result.truth[0] = -0.0;
  Store store = create(1);
  store.commit({&delivery, 1});
  EXPECT_EQ(std::bit_cast<std::uint64_t>(results_in(store)[0].truth[0]), 0u);
  EXPECT_EQ(test::num_contradicting(store.commit({&delivery, 1})), 0);
}

TEST_F(StoreTest, KeepsHealthAndWhereARunWasLost) {
  std::vector<Delivery> deliveries;
  for (const auto status : {RunStatus::completed, RunStatus::lost, RunStatus::no_draw}) {
    RunResult result = result_of(deliveries.size(), status);
    if (result.has_truth())
      result.health = test::values_of({1e-7, 1.0 / 3.0, 1.1e-12, 3e-4, magnitude_max});
    if (status == RunStatus::lost)
      result.loss = test::loss_of(LossCause::residual, SessionTarget::a_c12);
    deliveries.push_back({result, session_1, {1}, 1.0});
  }
  EXPECT_TRUE(create(3).commit(deliveries).empty());

  const std::vector<RunResult> results = results_in(Store::open(file()));
  for (std::size_t i = 0; i < deliveries.size(); ++i) {
    EXPECT_EQ(results[i].health, deliveries[i].result.health);
    EXPECT_EQ(results[i].loss, deliveries[i].result.loss);
  }
  const Database database(file(), Access::read_only);
  EXPECT_EQ(database.text("SELECT status || ' ' || loss_cause || ' ' || loss_session FROM"
                          " loop_health WHERE run_index = 1"),
            "lost residual a_c12");
  EXPECT_EQ(database.integer("SELECT count(*) FROM loop_health"), 2);
  EXPECT_EQ(database.integer("SELECT num_lost FROM campaign_progress"), 1);
}

TEST_F(StoreTest, HasNullWhereAResultHasNoMeaning) {
  std::vector<Delivery> deliveries;
  for (const auto status : {RunStatus::completed, RunStatus::not_converged, RunStatus::not_finite,
                            RunStatus::no_draw}) {
    RunResult result = result_of(deliveries.size(), status);
    if (!result.has_estimate())
      result.estimate.assign(num_parameters, std::numeric_limits<double>::quiet_NaN());
    if (!result.has_truth())
      result.truth.assign(num_parameters, std::numeric_limits<double>::infinity());
    deliveries.push_back({result, session_1, {1}, 1.0});
  }
  EXPECT_TRUE(create(4).commit(deliveries).empty());

  const Database database(file(), Access::read_only);
  const auto count = [&](const std::string& column) {
    return database.integer("SELECT count(" + column + ") FROM run_result");
  };
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    const std::string name = std::string(info.name) + std::string(info.unit_suffix);
    EXPECT_EQ(count("truth_" + name), 3);
    EXPECT_EQ(count("estimate_" + name), 2);
    EXPECT_EQ(count("error_" + name), 2);
  }
}

TEST_F(StoreTest, RefusesANumberThatIsNotFinite) {
  Store store = create(2);
  std::vector<Delivery> deliveries = deliveries_of(0, 2);
  deliveries[1].result.truth[0] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(store_error_of([&] { store.commit(deliveries); }),
            "run_result.truth_a_c11_delta_x_m of run 1 = inf (must be in [-1e+90, 1e+90])");
  deliveries[1] = delivery_of(1);
  deliveries[1].result.estimate[8] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(store_error_of([&] { store.commit(deliveries); }),
            "run_result.estimate_k2d_s2_m of run 1 = nan (must be in [-1e+90, 1e+90])");
  deliveries[1] = delivery_of(1);
  deliveries[1].compute_s = std::numeric_limits<double>::infinity();
  EXPECT_EQ(store_error_of([&] { store.commit(deliveries); }),
            "delivery.compute_s = inf (must be in [0, 1e9]; run 1)");
  EXPECT_THAT(store.finished_runs(), IsEmpty());
}

TEST_F(StoreTest, KeepsTheDigestOfItsTables) {
  Store store = Store::create(file(), campaign_with_data(3), "");
  const std::string digest_of_three = store.table_digest();
  EXPECT_EQ(store.computed_table_digest(), digest_of_three);
  store.extend(campaign_with_data(4), "");
  const std::string digest_of_four = store.table_digest();
  EXPECT_NE(digest_of_four, digest_of_three);
  store.set_stop_plan({.stop_rule = "std(a_c13) within 5%", .num_runs_max = 9, .failures_max = 2});
  store.set_owner("anna");
  EXPECT_EQ(store.computed_table_digest(), store.table_digest());
  const std::string stored = store.table_digest();
  EXPECT_NE(stored, digest_of_four);
  for (const std::string change :
       {"UPDATE environment_row SET linear_y_m_s2 = linear_y_m_s2 + 1e-12 WHERE position = 2",
        "DELETE FROM environment_row WHERE position = 1",
        "UPDATE dispersion_value SET value = value + 1e-12 WHERE run_index = 3",
        "UPDATE dispersion_value SET run_index = 9 WHERE run_index = 2",
        "UPDATE campaign SET name = 'x'", "UPDATE campaign SET seed = '2'",
        "UPDATE campaign SET num_runs = 5", "UPDATE campaign SET definition = 'x'",
        "UPDATE campaign SET model_version = 'x'", "UPDATE campaign SET build = 'x'",
        "UPDATE campaign SET model_description = 'x'", "UPDATE campaign SET created_utc = 'x'",
        "UPDATE campaign SET campaign_uid = 7", "UPDATE campaign SET owner = 'bert'",
        "UPDATE campaign SET stop_rule = ''", "UPDATE campaign SET num_runs_max = NULL",
        "UPDATE campaign SET failures_max = 3"}) {
    const std::filesystem::path copy = directory() / "copy.db";
    store.back_up(copy);
    test::change(copy, change);
    const Store changed = Store::open_read_only(copy);
    EXPECT_EQ(changed.table_digest(), stored);
    EXPECT_NE(changed.computed_table_digest(), stored) << change;
    std::filesystem::remove(copy);
  }
}

// The SHA-256 of thirteen texts and of two numbers of rows, both 0, by another program (hashlib of
// Python).
TEST_F(StoreTest, HasTheKnownDigestOfADefinition) {
  (void)Store::create(file(), campaign_of(3), "d");
  change(
      "UPDATE campaign SET model_version = 'm', build = 'b', created_utc = 'c',"
      " campaign_uid = 7");
  EXPECT_EQ(Store::open_read_only(file()).computed_table_digest(),
            "5509dd21e1bb692b627bf7def27c168579a5c119cfad179f1eb1afac15402055");
}

TEST_F(StoreTest, IsReadableInADirectoryThatIsNotWritable) {
  create(3).commit(deliveries_of(0, 3));
  std::filesystem::permissions(file(), std::filesystem::perms(0444));
  std::filesystem::permissions(directory(), std::filesystem::perms(0555));
  std::size_t num_results = 0;
  {
    const test::OrdinaryUser user;
    num_results = results_in(Store::open_read_only(file())).size();
  }
  std::filesystem::permissions(directory(), std::filesystem::perms(0755));
  EXPECT_EQ(num_results, 3u);
}

}  // namespace
}  // namespace proofmass::coordinator
