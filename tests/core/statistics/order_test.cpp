#include "core/statistics/order.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/error.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

using testing::ElementsAre;

TEST(Percentile, InterpolatesBetweenNeighbours) {
  const std::vector<double> values{10.0, 20.0, 30.0, 50.0};  // Places 0 to 3.
  EXPECT_EQ(percentile(values, 0.0), 10.0);
  EXPECT_EQ(percentile(values, 0.5), 25.0);   // Place 1.5.
  EXPECT_EQ(percentile(values, 0.75), 35.0);  // Place 2.25.
  EXPECT_EQ(percentile(values, 1.0), 50.0);
}

TEST(Percentile, OfASingleValueIsTheValue) {
  EXPECT_EQ(percentile(std::vector<double>{7.0}, 0.99), 7.0);
}

TEST(Percentile, RefusesALevelOutsideItsRange) {
  const std::vector<double> values{1.0, 2.0};
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)percentile(values, 1.5); }),
            "level = 1.5 (must be in [0, 1])");
}

TEST(Percentile, RefusesNoValues) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)percentile({}, 0.5); }),
            "values = 0 values (must be at least 1)");
}

TEST(AverageRanks, AreSharedByEqualValues) {
  EXPECT_THAT(average_ranks(std::vector<double>{3.0, 1.0, 3.0, 2.0, 3.0}),
              ElementsAre(4.0, 1.0, 4.0, 2.0, 4.0));
}

TEST(AscendingOrder, KeepsTheOrderOfEqualValues) {
  EXPECT_THAT(ascending_order(std::vector<double>{3.0, 1.0, 3.0, 1.0}), ElementsAre(1, 3, 0, 2));
}

TEST(Sorted, LeavesNothingOut) {
  EXPECT_THAT(sorted(std::vector<double>{3.0, 1.0, 3.0}), ElementsAre(1.0, 3.0, 3.0));
}

}  // namespace
}  // namespace proofmass
