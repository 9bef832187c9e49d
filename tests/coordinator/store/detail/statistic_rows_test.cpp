#include "coordinator/store/detail/statistic_rows.hpp"

#include <gmock/gmock.h>

#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

TEST(WorstRuns, TakeWhatIsLargerThanTheSmallest) {
  WorstRuns worst;
  for (std::uint64_t run = 0; run < num_worst_runs; ++run) {
    const WorstRuns::Change change =
        worst.offer({.magnitude = static_cast<double>(run), .run = RunIndex{run}});
    EXPECT_TRUE(change.is_taken);
    EXPECT_FALSE(change.dropped);
  }
  EXPECT_FALSE(worst.offer({.magnitude = 0.0, .run = RunIndex{20}}).is_taken);
  const WorstRuns::Change change = worst.offer({.magnitude = 0.5, .run = RunIndex{20}});
  EXPECT_TRUE(change.is_taken);
  EXPECT_EQ(change.dropped, RunIndex{0});
  EXPECT_THAT(worst.runs(), SizeIs(num_worst_runs));
  EXPECT_EQ(worst.runs().front(), (RankedRun{9.0, RunIndex{9}}));
  EXPECT_EQ(worst.runs().back(), (RankedRun{0.5, RunIndex{20}}));
}

TEST(WorstRuns, PreferTheFirstOfEqualOnes) {
  WorstRuns worst;
  for (std::uint64_t run = 20; run > 10; --run)
    worst.offer({.magnitude = 1.0, .run = RunIndex{run}});
  EXPECT_FALSE(worst.offer({.magnitude = 1.0, .run = RunIndex{21}}).is_taken);
  EXPECT_EQ(worst.offer({.magnitude = 1.0, .run = RunIndex{3}}).dropped, RunIndex{20});
  EXPECT_EQ(worst.runs().front().run, RunIndex{3});
  EXPECT_EQ(worst.runs().back().run, RunIndex{19});
}

TEST(ExceededObjectives, AreThoseOfRunsThatHaveAnEstimate) {
  std::vector<double> objectives;
  objectives.assign(num_parameters, 1.0);
  RunResult result = test::zero_result({.run = RunIndex{1}, .status = RunStatus::completed});
  EXPECT_EQ(exceeded_objectives(result, objectives), 0u);
  result.estimate[0] = -1.5;
  result.estimate[1] = 1.0;
  result.estimate[9] = 2.0;
  EXPECT_EQ(exceeded_objectives(result, objectives), (1u << 0) | (1u << 9));
  result.status = RunStatus::not_finite;
  EXPECT_EQ(exceeded_objectives(result, objectives), 0u);
}

}  // namespace
}  // namespace proofmass::coordinator::detail
