#include "core/campaign/result_columns.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::UnorderedElementsAreArray;

using ResultColumns = test::StoreTest;

// SQL knows the columns by the same names, so that what is learned with one tool holds in another.
TEST_F(ResultColumns, AreThoseOfTheTable) {
  std::vector<Delivery> deliveries = test::deliveries_of(0, 4);
  for (std::size_t i = 0; i < 4; ++i) {
    deliveries[i].result.status = static_cast<RunStatus>(i + 1);
  }
  create(4).commit(deliveries);
  const detail::Database database(file(), detail::Access::read_only);
  for (const ValueColumn& column : value_columns(test::schema())) {
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

TEST_F(ResultColumns, HaveNamesThatAreAllOfTheTable) {
  create(1);
  const detail::Database database(file(), detail::Access::read_only);
  std::vector<std::string> names;
  for (detail::Statement row =
           database.prepare("SELECT name FROM pragma_table_xinfo('run_result')");
       row.step();) {
    names.push_back(row.text(0));
  }
  EXPECT_THAT(result_column_names(test::schema()), UnorderedElementsAreArray(names));
}

/// A result with standard errors σ_i = 2^(−10 − i): errors of 1σ, 2σ, 3σ in turn with the run.
Delivery delivery_with_standard_errors(std::uint64_t run) {
  Delivery delivery = test::delivery_of(run);
  RunResult& result = delivery.result;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    const double sigma = std::ldexp(1.0, -10 - static_cast<int>(i));
    result.truth[i] = 0.5;
    result.estimate[i] = 0.5 - static_cast<double>(run % 3 + 1) * sigma;
    result.standard_error.push_back(sigma);
  }
  result.fit = {36.25, 37.5};
  result.correlations.assign(45, -0.000125);
  result.correlations[44] = 1.0 / 3.0;
  return delivery;
}

TEST_F(ResultColumns, KeepStandardErrorsAndTheirFit) {
  Store store = create(10);
  std::vector<Delivery> deliveries = test::deliveries_of(4, 5);  // Without standard errors.
  for (std::uint64_t run = 0; run < 4; ++run) {
    deliveries.push_back(delivery_with_standard_errors(run));
  }
  store.commit(deliveries);
  std::vector<RunResult> results;
  store.for_each_result([&](const RunResult& result) { results.push_back(result); });
  ASSERT_EQ(results.size(), 5U);
  EXPECT_EQ(results[3].standard_error, deliveries[4].result.standard_error);
  EXPECT_EQ(results[3].fit, deliveries[4].result.fit);
  EXPECT_EQ(results[3].correlations, deliveries[4].result.correlations);
  EXPECT_TRUE(results[4].standard_error.empty());
  EXPECT_TRUE(results[4].fit.empty());
  EXPECT_TRUE(results[4].correlations.empty());
  EXPECT_EQ(text("SELECT json_extract(correlations, '$[0]') || ' ' || json_array_length("
                 "correlations) FROM run_result WHERE run_index = 3"),
            "-0.000125 45");
  EXPECT_EQ(text("SELECT group_concat(standard_error * 1024.0) FROM error_long WHERE run_index = 0"
                 " AND parameter IN ('a_c11_delta_x', 'a_c11_delta_z')"),
            "1.0,0.5");
  EXPECT_EQ(text("SELECT chi_squared || ' ' || degrees_of_freedom FROM run WHERE run_index = 1"),
            "36.25 37.5");
  // Errors of 1, 2, 3, 1 standard errors: a mean square of 15/4, two of four below 1.96.
  EXPECT_EQ(text("SELECT group_concat(DISTINCT num_runs || ' ' || squared_ratio || ' ' || "
                 "within_95) FROM standard_errors"),
            "4 3.75 0.5");
  EXPECT_EQ(text("SELECT group_concat(parameter) FROM standard_errors"),
            text("SELECT group_concat(parameter) FROM (SELECT parameter FROM parameter ORDER BY "
                 "position)"));
}

TEST_F(ResultColumns, HaveNoHalfOfTheStandardErrors) {
  create(10).commit(std::vector{delivery_with_standard_errors(0)});
  const auto refusal = [&] {
    return test::store_error_of(
        [&] { Store::open_read_only(file()).for_each_result([](const RunResult&) {}); });
  };
  for (const char* const other :
       {"'[0.5]'", "replace(correlations, '0.3333', '1.3333')", "correlations || ' '", "NULL"}) {
    const std::string before = text("SELECT correlations FROM run_result");
    change(std::string("UPDATE run_result SET correlations = ") + other);
    EXPECT_THAT(refusal(), HasSubstr("correlations of run 0"));
    change("UPDATE run_result SET correlations = '" + before + "'");
  }
  change("UPDATE run_result SET fit_degrees_of_freedom = -1");
  EXPECT_THAT(refusal(), HasSubstr("fit_degrees_of_freedom of run 0 (must be in [0, 1e+90])"));
  change("UPDATE run_result SET fit_chi_squared = NULL");
  EXPECT_THAT(refusal(), HasSubstr("fit_chi_squared of run 0 (must be in [0, 1e+90])"));
  change("UPDATE run_result SET standard_error_k2c_s2_m = NULL");
  EXPECT_THAT(refusal(), HasSubstr("standard_error_k2c_s2_m = NULL of run 0"));
}

TEST(ValueColumns, HaveTheUnitOfTheirParameter) {
  EXPECT_EQ(value_columns(test::schema())[3].name, "truth_a_c12_rad");
  EXPECT_EQ(value_columns(test::schema())[3].own_name, "a_c12_rad");
  EXPECT_EQ(value_columns(test::schema())[3].unit, "rad");
  EXPECT_EQ(value_columns(test::schema())[29].name, "error_k2c_s2_m");
  EXPECT_EQ(value_columns(test::schema())[29].unit, "s²/m");
  EXPECT_EQ(value_columns(test::schema())[33].name, "standard_error_a_c12_rad");
  EXPECT_EQ(value_columns(test::schema())[33].unit, "rad");
  EXPECT_EQ(value_columns(test::schema())[40].name, "fit_chi_squared");
  EXPECT_EQ(value_columns(test::schema())[43].name, "health_attitude_rad");
  EXPECT_EQ(value_columns(test::schema())[43].unit, "rad");
}

TEST(SameBits, AreMoreThanEqualValuesAndKnowNoSignOfZero) {
  EXPECT_TRUE(have_same_bits(0.0, -0.0));
  EXPECT_TRUE(have_same_bits(1.0 / 3.0, 1.0 / 3.0));
  EXPECT_FALSE(have_same_bits(1.0, std::nextafter(1.0, 2.0)));
}

}  // namespace
}  // namespace proofmass::coordinator
