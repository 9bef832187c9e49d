#include "core/campaign/run_result.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace proofmass {
namespace {

constexpr std::uint32_t draws_max = 1000;
constexpr std::int64_t rounds_max = 10;

/// The first rule that such a result breaks.
std::string broken(RunStatus status, std::uint32_t num_draws, std::uint32_t num_rounds) {
  const RunResult result{
      .run = {0}, .status = status, .num_draws = num_draws, .num_rounds = num_rounds};
  const std::vector<std::string> rules = broken_count_rules(result, draws_max, rounds_max);
  return rules.empty() ? "" : rules.front();
}

// What draw_instrument() and estimate_hardy2013() can count.
TEST(RunResult, HasTheCountsThatItsStatusAllows) {
  EXPECT_EQ(broken(RunStatus::completed, 1, 3), "");
  EXPECT_EQ(broken(RunStatus::completed, 1000, 10), "");
  EXPECT_EQ(broken(RunStatus::not_converged, 1, 10), "");
  EXPECT_EQ(broken(RunStatus::not_finite, 2, 0), "");
  EXPECT_EQ(broken(RunStatus::no_draw, 1000, 0), "");
}

TEST(ResultSchema, HasTheQuantityInTheMiddleAsAnExample) {
  for (const std::size_t num_quantities : {1U, 2U, 3U, 10U}) {
    ResultSchema schema;
    schema.quantities.resize(num_quantities);
    EXPECT_EQ(&example_quantity(schema), &schema.quantities[(num_quantities - 1) / 2]);
  }
}

TEST(RunResult, OfImpossibleCountsBreaksARuleThatIsNamed) {
  EXPECT_EQ(broken(RunStatus::completed, 0, 3), "num_draws = 0 (must be 1 to 1000 if completed)");
  EXPECT_EQ(broken(RunStatus::completed, 4294967295, 3),
            "num_draws = 4294967295 (must be 1 to 1000 if completed)");
  EXPECT_EQ(broken(RunStatus::completed, 1, 11), "num_rounds = 11 (must be 0 to 10 if completed)");
  EXPECT_EQ(broken(RunStatus::not_converged, 1, 9),
            "num_rounds = 9 (must be 10 to 10 if not_converged)");
  EXPECT_EQ(broken(RunStatus::no_draw, 999, 0),
            "num_draws = 999 (must be 1000 to 1000 if no_draw)");
  EXPECT_EQ(broken(RunStatus::no_draw, 1000, 1), "num_rounds = 1 (must be 0 to 0 if no_draw)");
  EXPECT_EQ(broken_count_rules(
                {.run = {0}, .status = RunStatus::no_draw, .num_draws = 7, .num_rounds = 5},
                draws_max, rounds_max)
                .size(),
            2U);
}

}  // namespace
}  // namespace proofmass
