#include <gmock/gmock.h>

#include <limits>
#include <set>

#include "coordinator/store/detail/rows.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator::detail {
namespace {

RunResult known_result(RunStatus status) {
  RunResult result =
      test::zero_result({.run = RunIndex{7}, .status = status, .num_draws = 2, .num_rounds = 3});
  result.truth = {1.0, -0.5, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-300};
  result.estimate.assign(num_parameters, 2.0);
  return result;
}

// The expected digests are those of an FNV-1a written in Python over the packed numbers.
TEST(ResultDigest, IsFnv1aOfAllThatMeansSomething) {
  EXPECT_EQ(digest(known_result(RunStatus::completed)), 0xe4a0593635d4e6e6u);
  EXPECT_EQ(digest(known_result(RunStatus::not_finite)), 0x0a65db6f5187caccu);
  EXPECT_EQ(digest(known_result(RunStatus::no_draw)), 0x560ac63e54f38b87u);
}

TEST(ResultDigest, HasHealthAndLossAtItsEnd) {
  RunResult completed = known_result(RunStatus::completed);
  completed.health = test::values_of({1e-7, 2e-5, 1e-12, 0.25, 3e-4});
  EXPECT_EQ(digest(completed), 0xeec8560525c74118u);
  RunResult lost = known_result(RunStatus::lost);
  lost.health = completed.health;
  lost.loss = test::loss_of(LossCause::residual, SessionTarget::k2d);
  EXPECT_EQ(digest(lost), 0xcc77843cddfcfc4eu);
}

TEST(ResultDigest, DoesNotDependOnTheSignOfAZeroOrOnWhatMeansNothing) {
  RunResult result = known_result(RunStatus::not_finite);
  result.truth[3] = -0.0;
  result.estimate.assign(num_parameters, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(digest(result), digest(known_result(RunStatus::not_finite)));
  EXPECT_TRUE(are_equal(result, known_result(RunStatus::not_finite)));
}

TEST(ResultDigest, DependsOnEveryNumber) {
  const RunResult known = known_result(RunStatus::completed);
  std::vector<RunResult> changed(4, known);
  changed[0].run.value = 8;
  changed[1].status = RunStatus::not_converged;
  changed[2].num_draws = 3;
  changed[3].num_rounds = 2;
  for (std::size_t i = 0; i < num_parameters; ++i) {
    changed.insert(changed.end(), 2, known);
    changed.back().truth[i] += 1.0;
    changed[changed.size() - 2].estimate[i] += 1.0;
  }
  std::set<std::uint64_t> digests{digest(known)};
  for (const RunResult& result : changed) {
    digests.insert(digest(result));
    EXPECT_FALSE(are_equal(result, known));
  }
  EXPECT_EQ(digests.size(), 1 + changed.size());
}

TEST(ResultDigest, DependsOnStandardErrorsAndTheirFit) {
  const RunResult known = known_result(RunStatus::completed);
  RunResult with_errors = known;
  with_errors.standard_error.assign(num_parameters, 0.5);
  with_errors.fit = {3.0, 4.0};
  RunResult other_fit = with_errors;
  other_fit.fit[0] = 3.5;
  RunResult other_correlations = with_errors;
  other_correlations.correlations = {0.5};
  for (const auto& [a, b] : {std::pair{known, with_errors}, std::pair{with_errors, other_fit},
                             std::pair{with_errors, other_correlations}}) {
    EXPECT_NE(digest(a), digest(b));
    EXPECT_FALSE(are_equal(a, b));
  }
}

TEST(AreEqual, ComparesHealthAndLoss) {
  const RunResult known = known_result(RunStatus::lost);
  RunResult other = known;
  other.health = test::values_of({.square_noise = 1e-9});
  EXPECT_FALSE(are_equal(other, known));
  other = known;
  other.loss = test::loss_of(LossCause::attitude, SessionTarget::k2d);
  EXPECT_FALSE(are_equal(other, known));
}

}  // namespace
}  // namespace proofmass::coordinator::detail
