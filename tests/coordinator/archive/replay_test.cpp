#include "coordinator/archive/replay.hpp"

#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using ReplayTest = test::StoreTest;

TEST_F(ReplayTest, IsOfRunsThatHaveAResult) {
  const MicroscopeCampaign campaign = test::quick_campaign(9);
  Store store = test::store_of(file(), campaign, {test::result_of(2)});
  const Entry entry = GivenUpRun{RunIndex{5}};
  (void)store.write({&entry, 1});
  const Replay again(store);
  EXPECT_EQ(again.stored_result(RunIndex{2}).run, RunIndex{2});
  EXPECT_EQ(test::error_of([&] { (void)again.stored_result(RunIndex{5}); }),
            "run = 5 (has no result: it was given up after it had crashed)");
}

/// A result whose only error is that of a parameter, in units of its objective.
RunResult result_with(std::uint64_t run, Parameter parameter, double ratio) {
  RunResult result = test::result_of(run);
  result.estimate = result.truth;
  const std::size_t i = index(parameter);
  result.truth[i] = 0.0;
  result.estimate[i] = ratio * MicroscopeCampaign().scenario.objectives[i];
  return result;
}

TEST_F(ReplayTest, FindsTheWorstRuns) {
  std::vector<RunResult> results{
      result_with(0, Parameter::k2c, 0.5), result_with(1, Parameter::a_c13, -2.0),
      result_with(2, Parameter::k2d, 2.0), test::result_of(3, RunStatus::not_finite),
      result_with(4, Parameter::a_d12, 3.0)};
  const Store store = test::store_of(file(), test::quick_campaign(5), results);
  const Replay again(store);
  const auto worst = [&](std::size_t count) {
    std::vector<std::uint64_t> runs;
    for (const RunResult& result : again.worst_results(count, test::never_stopped)) {
      runs.push_back(result.run.value);
    }
    return runs;
  };
  EXPECT_THAT(worst(1), ElementsAre(4));
  EXPECT_THAT(worst(2), ElementsAre(4, 1));  // Of equal ones the first.
  EXPECT_THAT(worst(3), ElementsAre(4, 1, 2));
  EXPECT_THAT(worst(9), ElementsAre(4, 1, 2, 0));
}

}  // namespace
}  // namespace proofmass::coordinator
