#include "core/statistics/correlation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/error.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

using Values = std::vector<double>;

// x = 1 to 5 against 2, 1, 4, 3, 5: Σdxdy = 8, Σdx² = Σdy² = 10.
TEST(LinearCorrelation, IsThatOfPaperAndPencil) {
  const Values x{1, 2, 3, 4, 5};
  const Values y{2, 1, 4, 3, 5};
  EXPECT_DOUBLE_EQ(linear_correlation(x, y).value(), 0.8);
}

TEST(LinearCorrelation, DoesNotFeelAnOffset) {
  const Values x{1, 2, 3, 4, 5};
  const Values y{1e8 + 2, 1e8 + 1, 1e8 + 4, 1e8 + 3, 1e8 + 5};
  EXPECT_DOUBLE_EQ(linear_correlation(x, y).value(), 0.8);
}

TEST(LinearCorrelation, OfALineIsOne) {
  EXPECT_EQ(linear_correlation(Values{1, 2, 3, 4}, Values{-2, -4, -6, -8}), -1.0);
}

TEST(RankCorrelation, SeesAnyMonotoneRelation) {
  Values x, y;
  for (int i = 1; i < 20; ++i) {
    x.push_back(i);
    y.push_back(std::exp(i));
  }
  EXPECT_DOUBLE_EQ(rank_correlation(x, y).value(), 1.0);
  EXPECT_LT(linear_correlation(x, y).value(), 0.7);
}

// Ranks of 1, 1, 2, 3 are 1.5, 1.5, 3, 4: Σdxdy = 4.5 over √(5 · 4.5).
TEST(RankCorrelation, SharesRanksOfEqualValues) {
  const auto correlation = rank_correlation(Values{1, 2, 3, 4}, Values{1, 1, 2, 3});
  EXPECT_DOUBLE_EQ(correlation.value(), 4.5 / std::sqrt(22.5));
}

// Around 2⁵³ only even numbers are doubles: the mean, M + 1, is rounded to M.
TEST(LinearCorrelation, IsZeroOfPatternsWhoseMeanIsNoDouble) {
  constexpr double m = 0x1p53;
  const Values x{m, m, m + 2, m + 2};
  const Values y{m, m + 2, m, m + 2};
  EXPECT_EQ(linear_correlation(x, y), 0.0);
}

TEST(Correlations, AreEmptyWithoutVariationOrValues) {
  const Values constant(5, 2.0);
  const Values x{1, 2, 3, 4, 5};
  EXPECT_FALSE(linear_correlation(x, constant).has_value());
  EXPECT_FALSE(rank_correlation(constant, x).has_value());
  EXPECT_FALSE(linear_correlation(Values{1, 2, 3}, Values{3, 1, 2}).has_value());
  EXPECT_FALSE(rank_correlation(Values{1, 2, 3}, Values{3, 1, 2}).has_value());
}

TEST(Correlations, RefuseWhatTheyCannotWorkWith) {
  const Values x{1, 2, 3, 4};
  EXPECT_EQ(test::message_of<InvalidArgument>([&] {
              (void)linear_correlation(x, Values{1, 2});
            }),
            "y = 2 values (must be as many as the others, 4)");
  const Values broken{1, 2, std::numeric_limits<double>::quiet_NaN(), 4};
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)rank_correlation(x, broken); }),
            "y[2] = nan (must be finite)");
}

}  // namespace
}  // namespace proofmass
