#include "core/microscope/environment/environment_table.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "core/error.hpp"

namespace proofmass {
namespace {

constexpr double period_s = 5950.0;

EnvironmentTable valid_table() { return {{0.0, {}, {}}, {3000.0, {}, {}}, {5950.0, {}, {}}}; }

std::string refusal(const EnvironmentTable& table) {
  try {
    validate_environment_table(table, period_s);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(EnvironmentTable, MayCoverJustOneOrbit) { EXPECT_EQ(refusal(valid_table()), "accepted"); }

TEST(EnvironmentTable, MayStartBeforeTheSession) {
  EnvironmentTable table = valid_table();
  table.front().time_s = -100.0;
  EXPECT_EQ(refusal(table), "accepted");
}

TEST(EnvironmentTable, NeedsTwoRows) {
  EXPECT_EQ(refusal({}), "environment.file = 0 rows (must have 2 to 200000)");
  EXPECT_EQ(refusal({{0.0, {}, {}}}), "environment.file = 1 rows (must have 2 to 200000)");
}

TEST(EnvironmentTable, HasALimitOfRows) {
  EnvironmentTable table(environment_rows_max + 1);
  for (std::size_t i = 0; i < table.size(); ++i) table[i].time_s = static_cast<double>(i);
  EXPECT_EQ(refusal(table), "environment.file = 200001 rows (must have 2 to 200000)");
  table.pop_back();
  EXPECT_EQ(refusal(table), "accepted");
}

TEST(EnvironmentTable, RefusesWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EnvironmentTable table = valid_table();
  table[1].time_s = nan;
  EXPECT_EQ(refusal(table), "environment.file row 2 = nan (must be finite)");
  table = valid_table();
  table[0].linear_m_s2[2] = infinity;
  EXPECT_EQ(refusal(table), "environment.file row 1 = inf (must be finite)");
  table = valid_table();
  table[2].angular_rad_s2[1] = -infinity;
  EXPECT_EQ(refusal(table), "environment.file row 3 = -inf (must be finite)");
}

TEST(EnvironmentTable, RefusesAFirstTimeAfterTheStart) {
  EnvironmentTable table = valid_table();
  table.front().time_s = 0.25;
  EXPECT_EQ(refusal(table), "environment.file row 1 = 0.25 (the first time_s must be <= 0)");
}

TEST(EnvironmentTable, RefusesTimesThatDoNotAscend) {
  EnvironmentTable table = valid_table();
  table.insert(table.begin() + 1, {3000.0, {}, {}});
  EXPECT_EQ(refusal(table),
            "environment.file row 3 = 3000 (time_s must be > 3000, that of the row before)");
}

TEST(EnvironmentTable, RefusesLessThanAnOrbit) {
  EnvironmentTable table = valid_table();
  table.back().time_s = 5949.0;
  EXPECT_EQ(refusal(table),
            "environment.file row 3 = 5949 (the last time_s must be >= one orbit, 5950 s)");
}

}  // namespace
}  // namespace proofmass
