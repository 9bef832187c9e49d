#include "tests/benchmarks/bench/bench_parts.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

RunResult result(std::uint64_t run) {
  RunResult result = test::zero_result({.run = {run}});
  result.num_draws = 1;
  result.num_rounds = 4;
  result.truth[3] = 0.0;
  result.estimate[9] = 1.5;
  return result;
}

TEST(SameBits, AreSeenInEveryField) {
  const RunResult reference = result(7);
  EXPECT_TRUE(agree_to_the_bit(reference, result(7)));
  EXPECT_FALSE(agree_to_the_bit(reference, result(8)));
  RunResult other = reference;
  other.status = RunStatus::not_converged;
  EXPECT_FALSE(agree_to_the_bit(reference, other));
  other = reference;
  other.num_draws = 2;
  EXPECT_FALSE(agree_to_the_bit(reference, other));
  other = reference;
  other.num_rounds = 5;
  EXPECT_FALSE(agree_to_the_bit(reference, other));
  other = reference;
  other.truth[3] = -0.0;
  EXPECT_FALSE(agree_to_the_bit(reference, other));
  other = reference;
  other.estimate[9] = std::nextafter(1.5, 2.0);
  EXPECT_FALSE(agree_to_the_bit(reference, other));
}

TEST(SameBits, AreThoseOfANanWithItself) {
  RunResult a = result(0);
  a.estimate[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(agree_to_the_bit(a, a));
}

TEST(KnownResults, GrowByRunsThatNobodyComputedBefore) {
  std::vector<RunResult> known;
  EXPECT_TRUE(agree_with_known(std::vector{result(0)}, known));
  EXPECT_TRUE(agree_with_known(std::vector{result(0), result(1), result(2)}, known));
  ASSERT_EQ(known.size(), 3U);
  EXPECT_EQ(known[2].run, RunIndex{2});
}

TEST(KnownResults, AreNotReplacedByOthers) {
  std::vector<RunResult> known{result(0), result(1)};
  RunResult other = result(1);
  other.estimate[0] = 3.0;
  EXPECT_FALSE(agree_with_known(std::vector{result(0), other, result(2)}, known));
  EXPECT_EQ(known[1].estimate[0], 0.0);
  EXPECT_TRUE(agree_with_known(std::vector{result(0), result(1), result(2)}, known));
}

}  // namespace
}  // namespace proofmass::test
