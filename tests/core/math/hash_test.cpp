#include "core/math/hash.hpp"

#include <gtest/gtest.h>

namespace proofmass {
namespace {

// Test vectors of RFC 9923, appendix C.
TEST(Fnv1a, IsThatOfTheStandard) {
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325U);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cU);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8U);
}

// The first three outputs of SplitMix64 with seed 1234567, whose state grows by the constant.
TEST(Mixed, IsTheOutputOfSplitMix64) {
  constexpr std::uint64_t increment = 0x9e3779b97f4a7c15;
  EXPECT_EQ(mixed(1234567), 6457827717110365317U);
  EXPECT_EQ(mixed(1234567 + increment), 3203168211198807973U);
  EXPECT_EQ(mixed(1234567 + 2 * increment), 9817491932198370423U);
}

TEST(FractionOf, IsBelowOne) {
  EXPECT_EQ(fraction_of(0), 0.0);
  EXPECT_EQ(fraction_of(std::uint64_t{1} << 63), 0.5);
  EXPECT_LT(fraction_of(~std::uint64_t{0}), 1.0);
}

}  // namespace
}  // namespace proofmass
