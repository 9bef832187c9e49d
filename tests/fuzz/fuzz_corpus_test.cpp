// What the fuzzer begins from, and many changes of it, without the fuzzer.

#include "tests/fuzz/fuzz_input.hpp"
#include "tests/fuzz/mutator.hpp"
#include "tests/fuzz/seed_inputs.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

constexpr std::uint64_t num_shards = 4;
constexpr std::uint64_t num_mutations = 50'000;

TEST(FuzzInput, IsAListOfSteps) {
  const std::vector<Step> steps{
      {.kind = StepKind::worker_message, .number = 3, .value = 0, .content = "abc"},
      {.kind = StepKind::elapse, .number = 0, .value = 300, .content = {}}};
  const std::string bytes = to_bytes(steps);
  EXPECT_EQ(bytes, std::string("\x00\x03\x03\x00"
                               "abc"
                               "\x06\x00\x2c\x01",
                               11));
  const std::vector<Step> parsed = parse_steps(bytes);
  ASSERT_EQ(parsed.size(), 2U);
  EXPECT_EQ(parsed[0].number, 3);
  EXPECT_EQ(parsed[0].content, "abc");
  EXPECT_EQ(parsed[1].kind, StepKind::elapse);
  EXPECT_EQ(parsed[1].value, 300);
}

TEST(FuzzInput, MayEndAnywhere) {
  EXPECT_TRUE(parse_steps("\x06\x01\x02").empty());
  ASSERT_EQ(parse_steps(std::string("\x00\x00\x09\x00"
                                    "ab",
                                    6))
                .size(),
            1U);
  EXPECT_EQ(parse_steps(std::string("\x00\x00\x09\x00"
                                    "ab",
                                    6))[0]
                .content,
            "ab");
}

TEST(FuzzCorpus, ReachesAllThatItIsMeantToReach) {
  FuzzSummary sum;
  for (const auto& [name, bytes] : seed_inputs()) sum += run_fuzz_input(bytes);
  EXPECT_GT(sum.num_leases, 0U);
  EXPECT_GT(sum.num_rejections, 0U);
  EXPECT_GT(sum.num_committed, 0U);
  EXPECT_GT(sum.num_compared, 0U);
  EXPECT_GT(sum.num_lost, 0U);
  EXPECT_GT(sum.num_given_up, 0U);
  EXPECT_GT(sum.num_requests, 0U);
  EXPECT_GT(sum.num_replies, 0U);
  EXPECT_GT(sum.num_orders, 0U);
}

class FuzzMutations : public testing::TestWithParam<std::uint64_t> {};

TEST_P(FuzzMutations, BreakNothing) {
  std::vector<std::string> inputs;
  for (const auto& [name, bytes] : seed_inputs()) inputs.push_back(bytes);
  Mutator mutator(inputs, /*seed=*/GetParam() + 1);
  FuzzSummary sum;
  for (std::uint64_t i = 0; i < num_mutations / num_shards; ++i) {
    sum += run_fuzz_input(mutator.next());
  }
  // The inputs went beyond the first check.
  constexpr std::uint64_t often = num_mutations / num_shards / 50;
  EXPECT_GT(sum.num_leases, often);
  EXPECT_GT(sum.num_rejections, often);
  EXPECT_GT(sum.num_committed, often);
  EXPECT_GT(sum.num_compared, often);
  EXPECT_GT(sum.num_lost, often);
  EXPECT_GT(sum.num_requests, often);
  EXPECT_GT(sum.num_replies, often);
  EXPECT_GT(sum.num_orders, often);
}

INSTANTIATE_TEST_SUITE_P(Seeds, FuzzMutations, testing::Range<std::uint64_t>(0, num_shards));

}  // namespace
}  // namespace proofmass::test
