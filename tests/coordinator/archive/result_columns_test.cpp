#include "coordinator/archive/result_columns.hpp"

#include <gtest/gtest.h>

#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ResultColumns = test::StoreTest;

// SQL knows the columns by the same names, so that what is learned with one tool holds in another.
TEST_F(ResultColumns, AreThoseOfTheTable) {
  (void)test::store_of(file(), test::campaign_of(4), test::results_of_each_status(4));
  const detail::Database database(file(), detail::Access::read_only);
  for (const ValueColumn& column : value_columns()) {
    detail::Statement row = database.prepare("SELECT " + column.name + " IS NULL, " + column.name +
                                             ", status FROM run_result ORDER BY run_index");
    for (std::uint64_t run = 0; row.step(); ++run) {
      const RunResult result = test::result_of(run, static_cast<RunStatus>(row.integer(2)));
      const std::optional<double> value = column.value_in(result);
      EXPECT_EQ(value.has_value(), row.integer(0) == 0) << column.name << " of run " << run;
      if (!value) continue;
      EXPECT_EQ(test::bits_of(*value), test::bits_of(row.real(1))) << column.name;
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

TEST(RunStatusName, IsKnownForEach) {
  EXPECT_EQ(name_of(RunStatus::completed), "completed");
  EXPECT_EQ(name_of(RunStatus::not_converged), "not_converged");
  EXPECT_EQ(name_of(RunStatus::not_finite), "not_finite");
  EXPECT_EQ(name_of(RunStatus::no_draw), "no_draw");
}

TEST(SameBits, AreMoreThanEqualValuesAndKnowNoSignOfZero) {
  EXPECT_TRUE(have_same_bits(0.0, -0.0));
  EXPECT_TRUE(have_same_bits(1.0 / 3.0, 1.0 / 3.0));
  EXPECT_FALSE(have_same_bits(1.0, std::nextafter(1.0, 2.0)));
}

}  // namespace
}  // namespace proofmass::coordinator
