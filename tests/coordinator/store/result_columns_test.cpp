#include "coordinator/store/result_columns.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ResultColumns = test::StoreTest;

// SQL knows the columns by the same names, so that what is learned with one tool holds in another.
TEST_F(ResultColumns, AreThoseOfTheTable) {
  std::vector<Delivery> deliveries = test::deliveries_of(0, 4);
  for (std::size_t i = 0; i < 4; ++i) {
    deliveries[i].result.status = static_cast<RunStatus>(i + 1);
  }
  create(4).commit(deliveries);
  const detail::Database database(file(), detail::Access::read_only);
  for (const ValueColumn& column : value_columns()) {
    detail::Statement row = database.prepare("SELECT " + column.name + " IS NULL, " + column.name +
                                             ", status FROM run_result ORDER BY run_index");
    for (std::uint64_t run = 0; row.step(); ++run) {
      const RunResult result = test::result_of(run, static_cast<RunStatus>(row.integer(2)));
      const std::optional<double> value = column.value_in(result);
      EXPECT_EQ(value.has_value(), row.integer(0) == 0) << column.name << " of run " << run;
      if (!value) continue;
      EXPECT_TRUE(have_same_bits(*value, row.real(1))) << column.name;
    }
  }
}

TEST(ValueColumns, HaveTheUnitOfTheirParameter) {
  EXPECT_EQ(value_columns()[3].name, "truth_a_c12_rad");
  EXPECT_EQ(value_columns()[3].own_name, "a_c12_rad");
  EXPECT_EQ(value_columns()[3].unit, "rad");
  EXPECT_EQ(value_columns()[29].name, "error_k2c_s2_m");
  EXPECT_EQ(value_columns()[29].unit, "s²/m");
  EXPECT_EQ(value_columns()[31].name, "health_attitude_rad");
  EXPECT_EQ(value_columns()[31].unit, "rad");
}

TEST(SameBits, AreMoreThanEqualValuesAndKnowNoSignOfZero) {
  EXPECT_TRUE(have_same_bits(0.0, -0.0));
  EXPECT_TRUE(have_same_bits(1.0 / 3.0, 1.0 / 3.0));
  EXPECT_FALSE(have_same_bits(1.0, std::nextafter(1.0, 2.0)));
}

}  // namespace
}  // namespace proofmass::coordinator
