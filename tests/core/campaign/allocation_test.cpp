#include "core/campaign/allocation.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace proofmass {
namespace {

using Steps = std::span<const int>;

// Of variances aᵢ/nᵢ the sum is least where nᵢ is in proportion to √aᵢ (Neyman's allocation).
TEST(Allocation, IsInProportionToTheRootsOfVariances) {
  const auto value = [](Steps n) {
    const std::array<double, 4> variances{1.0, 4.0, 9.0, 16.0};
    double sum = 0.0;
    for (std::size_t i = 0; i < n.size(); ++i) sum -= variances[i] / n[i];
    return sum;
  };
  EXPECT_EQ(allocate(4, {.num_steps = 100, .minimum = 1}, value),
            (std::vector<int>{10, 20, 30, 40}));
  // Where the first must have 17, the others share the rest as 2 : 3 : 4.
  EXPECT_EQ(allocate(4, {.num_steps = 98, .minimum = 17}, value),
            (std::vector<int>{17, 18, 27, 36}));
}

/// Two unknowns of which three sessions see different mixtures: the errors add up.
double determinacy(Steps n) {
  const double a = 2.0 * n[0] + 0.3 * n[1] + 0.1, b = 0.2 * n[1] + 0.5 * n[2] + 0.1;
  const double c = 0.2 * n[1];
  const double determinant = a * b - c * c;
  return -(std::sqrt(b / determinant) + std::sqrt(a / determinant));
}

TEST(Allocation, IsTheBestOfAllThereAre) {
  for (const int num_steps : {3, 12, 31}) {
    double best = -1e300;
    for (int i = 1; i < num_steps - 1; ++i) {
      for (int j = 1; i + j < num_steps; ++j) {
        best = std::max(best, determinacy(std::array{i, j, num_steps - i - j}));
      }
    }
    const std::vector<int> found = allocate(3, {.num_steps = num_steps, .minimum = 1}, determinacy);
    EXPECT_EQ(found[0] + found[1] + found[2], num_steps);
    EXPECT_EQ(determinacy(found), best) << num_steps;
  }
}

TEST(Allocation, RefusesFewerStepsThanTheMinimumNeeds) {
  try {
    (void)allocate(3, {.num_steps = 11, .minimum = 4}, determinacy);
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_EQ(std::string(error.what()), "11 steps are fewer than 4 for each of 3 sessions");
  }
}

}  // namespace
}  // namespace proofmass
