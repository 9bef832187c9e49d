#include "core/campaign/field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/error.hpp"

namespace proofmass {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(Range, ContainsItsClosedEndsAndNotItsOpenOnes) {
  EXPECT_TRUE(range::between(1.0, 2.0).contains(1.0));
  EXPECT_TRUE(range::between(1.0, 2.0).contains(2.0));
  EXPECT_FALSE(range::between(1.0, 2.0).contains(std::nextafter(2.0, 3.0)));
  EXPECT_FALSE(range::between(1.0, 2.0).contains(std::nextafter(1.0, 0.0)));
  EXPECT_FALSE(range::positive.contains(0.0));
  EXPECT_TRUE(range::positive.contains(std::numeric_limits<double>::denorm_min()));
  EXPECT_TRUE(range::not_negative.contains(0.0));
  constexpr Range open_above{.maximum = 1.0, .maximum_open = true};
  EXPECT_FALSE(open_above.contains(1.0));
  EXPECT_TRUE(open_above.contains(-1e300));
}

TEST(Range, NeverContainsWhatIsNotFinite) {
  for (const double value : {infinity, -infinity, std::nan("")}) {
    EXPECT_FALSE(range::any.contains(value));
  }
}

TEST(Range, SaysItsRuleForPeople) {
  EXPECT_EQ(range::any.rule(), "must be finite");
  EXPECT_EQ(range::positive.rule(), "must be > 0");
  EXPECT_EQ(range::not_negative.rule(), "must be >= 0");
  EXPECT_EQ(range::between(0.1, 2.0).rule(), "must be in [0.1, 2]");
  EXPECT_EQ((Range{0.0, 1.0, true, true}.rule()), "must be in (0, 1)");
  EXPECT_EQ((Range{.maximum = 3.0}.rule()), "must be <= 3");
  EXPECT_EQ((Range{.maximum = 3.0, .maximum_open = true}.rule()), "must be < 3");
}

TEST(CheckField, NamesFieldValueAndRule) {
  const FieldInfo field{"estimation.transient_s", "", range::not_negative};
  EXPECT_NO_THROW(check_field(field, 0.0));
  try {
    check_field(field, -5.0);
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_STREQ(error.what(), "estimation.transient_s = -5 (must be >= 0)");
    EXPECT_EQ(error.field(), "estimation.transient_s");
  }
}

}  // namespace
}  // namespace proofmass
