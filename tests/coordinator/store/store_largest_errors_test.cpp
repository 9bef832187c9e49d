// Views that show errors: each in a row of its own, the worst ones, those beyond an objective.

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Access;
using detail::Database;
using detail::Statement;
using test::delivery_of;

using StoreLargestErrors = test::StoreTest;

/// A delivery with this estimate − truth of the parameter with index 4, a_c13, and of no other.
Delivery delivery_with_error(std::uint64_t run, double error) {
  Delivery delivery = delivery_of(run);
  delivery.result.truth.assign(num_parameters, 0.0);
  delivery.result.estimate.assign(num_parameters, 0.0);
  delivery.result.estimate[4] = error;
  return delivery;
}

void commit(Store& store, const Delivery& delivery) { store.commit({&delivery, 1}); }

TEST_F(StoreLargestErrors, ErrorsInLongFormAreThoseOfTheResults) {
  Store store = create(10);
  std::vector<Delivery> deliveries = test::deliveries_of(0, 4);
  deliveries[1].result.status = RunStatus::not_finite;
  deliveries[2].result.status = RunStatus::not_converged;
  deliveries[3].result.status = RunStatus::no_draw;
  store.commit(deliveries);
  const Database database(file(), Access::read_only);
  Statement row = database.prepare(
      "SELECT run_index, e.parameter, e.unit, truth, estimate, error FROM error_long AS e"
      " JOIN parameter AS p USING (parameter) ORDER BY run_index, position");
  for (const std::uint64_t run : {0u, 2u}) {
    for (const test::ParameterInfo& info : test::parameter_infos()) {
      const RunResult& result = deliveries[run].result;
      ASSERT_TRUE(row.step());
      EXPECT_EQ(row.count(0), run);
      EXPECT_EQ(row.text(1), info.name);
      EXPECT_EQ(row.text(2), info.unit);
      EXPECT_EQ(row.real(3), result.truth[index(info.parameter)]);
      EXPECT_EQ(row.real(4), result.estimate[index(info.parameter)]);
      EXPECT_EQ(row.real(5), result.error(index(info.parameter)));
    }
  }
  EXPECT_FALSE(row.step());
}

// All runs in one order, and in another in many transactions: the same ten, ties to the first.
TEST_F(StoreLargestErrors, WorstRunsAreTheSameInWhateverOrderTheyCome) {
  std::vector<Delivery> deliveries;
  for (std::uint64_t run = 0; run < 60; ++run) {
    // 1/16, 3/16, ... 39/16, three times each, with alternating signs.
    const double magnitude = 0.0625 + 0.125 * static_cast<double>(run % 20);
    const double error = run % 2 == 0 ? magnitude : -magnitude;
    deliveries.push_back(delivery_with_error(run, error));
  }
  std::mt19937 random(5);
  std::shuffle(deliveries.begin(), deliveries.end(), random);
  Store store = create(60);
  for (std::size_t first = 0; first < deliveries.size(); first += 7) {
    const std::size_t count = std::min<std::size_t>(7, deliveries.size() - first);
    store.commit(std::span(deliveries).subspan(first, count));
  }
  EXPECT_EQ(text("SELECT group_concat(place || ':' || run_index || ':' || error, ' ')"
                 " FROM worst_runs WHERE parameter = 'a_c13'"),
            "1:19:-2.4375 2:39:-2.4375 3:59:-2.4375 4:18:2.3125 5:38:2.3125 6:58:2.3125"
            " 7:17:-2.1875 8:37:-2.1875 9:57:-2.1875 10:16:2.0625");
  EXPECT_EQ(integer("SELECT count(*) FROM worst_runs"), 100);
  EXPECT_EQ(text("SELECT group_concat(DISTINCT parameter) FROM worst_runs"),
            "a_c11_delta_x,a_c11_delta_z,a_c11_delta_y,a_c12,a_c13,a_d11_prime,a_d12,a_d13,k2d,"
            "k2c");
  // Of errors that are all zero, the first runs.
  EXPECT_EQ(text("SELECT group_concat(run_index) FROM worst_runs WHERE parameter = 'k2c'"),
            "0,1,2,3,4,5,6,7,8,9");
  store.check_integrity();
}

// Ten of them are there: a smaller error of a later coordinator's is none, a larger one drops the
// smallest.
TEST_F(StoreLargestErrors, WorstRunsAreNoMoreThanTenAfterAFileIsOpened) {
  {
    Store store = create(60);
    for (std::uint64_t run = 0; run < 10; ++run) commit(store, delivery_with_error(run, 3.0));
  }
  Store store = Store::open(file());
  commit(store, delivery_with_error(20, 2.0));
  commit(store, delivery_with_error(21, 4.0));
  EXPECT_EQ(text("SELECT group_concat(run_index) FROM worst_runs WHERE parameter = 'a_c13'"),
            "21,0,1,2,3,4,5,6,7,8");
  store.check_integrity();
}

TEST_F(StoreLargestErrors, OverrunsAreErrorsAboveTheObjectiveOnly) {
  const double objective = MicroscopeCampaign{}.objectives()[4];
  Store store = create(10);
  std::vector<Delivery> deliveries{
      delivery_with_error(3, -2.0 * objective), delivery_with_error(1, objective),
      delivery_with_error(2, std::nextafter(objective, 1.0)), delivery_with_error(4, 0.0)};
  deliveries[3].result.estimate[0] = 1.0;
  deliveries[3].result.estimate[9] = 1e9;
  deliveries.push_back(delivery_with_error(5, 1.0));
  deliveries.back().result.status = RunStatus::not_finite;
  store.commit(deliveries);
  EXPECT_EQ(text("SELECT group_concat(run_index || ' ' || parameter, ';') FROM"
                 " (SELECT * FROM overruns ORDER BY run_index, ratio)"),
            "2 a_c13;3 a_c13;4 k2c;4 a_c11_delta_x");
  const Database database(file(), Access::read_only);
  Statement row =
      database.prepare("SELECT unit, objective, error, ratio FROM overruns WHERE run_index = 3");
  ASSERT_TRUE(row.step());
  EXPECT_EQ(row.text(0), "rad");
  EXPECT_EQ(row.real(1), objective);
  EXPECT_EQ(row.real(2), -2.0 * objective);
  EXPECT_EQ(row.real(3), 2.0);
  store.check_integrity();
}

TEST_F(StoreLargestErrors, ASecondResultOfARunChangesNothing) {
  Store store = create(10);
  commit(store, delivery_with_error(3, 0.0));
  commit(store, delivery_with_error(3, 1.0));
  EXPECT_EQ(integer("SELECT count(*) FROM overruns"), 0);
  EXPECT_EQ(integer("SELECT count(*) FROM worst_runs WHERE error = 0"), 10);
}

}  // namespace
}  // namespace proofmass::coordinator
