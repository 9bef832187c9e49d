#include "core/definition/nearest_name.hpp"

#include <gtest/gtest.h>

namespace proofmass::detail {
namespace {

TEST(EditDistance, CountsInsertionsDeletionsReplacementsAndSwaps) {
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("abc", ""), 3u);
  EXPECT_EQ(edit_distance("scael", "scale"), 1u);
  EXPECT_EQ(edit_distance("ca", "abc"), 3u);  // A swapped pair is not split again.
  EXPECT_EQ(edit_distance("scale", "scale"), 0u);
}

TEST(NearestName, IsTheCandidateWithTheFewestEdits) {
  EXPECT_EQ(nearest_name("noise.scal", {"noise.preset", "noise.scale", "orbit.period_s"}),
            "noise.scale");
}

TEST(NearestName, IsNothingIfNoCandidateIsNear) {
  EXPECT_EQ(nearest_name("weather", {"noise.preset", "noise.scale"}), std::nullopt);
  EXPECT_EQ(nearest_name("weather", {}), std::nullopt);
}

}  // namespace
}  // namespace proofmass::detail
