#include "coordinator/report/verification_matrix.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t a_c12 = static_cast<std::size_t>(Parameter::a_c12);

/// Objectives of 1 for all parameters.
std::vector<double> ones() { return std::vector<double>(num_parameters, 1.0); }

/// Errors between 0 and 1, the same in all parameters but for a factor.
double error_of_run(std::uint64_t run) {
  return static_cast<double>((run * 7919) % 10'007) / 10'007.0;
}

RunResult result_with(std::uint64_t run, double error) {
  RunResult result = test::zero_result({.run = {run}, .num_draws = 1});
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.estimate[i] = error / static_cast<double>(i + 1);
  }
  return result;
}

std::vector<MatrixRow> rows_of(const std::vector<StatedRequirement>& stated,
                               const std::vector<RunResult>& results,
                               std::uint64_t num_given_up = 0,
                               std::optional<std::uint64_t> num_fixed = {}) {
  const std::vector<double> objectives = ones();
  MatrixPasses passes(stated, objectives, num_given_up, num_fixed);
  do {
    for (const RunResult& result : results) passes.add(result);
  } while (passes.end_pass());
  return passes.rows();
}

std::vector<RunResult> some_results(std::uint64_t count) {
  std::vector<RunResult> results;
  for (std::uint64_t run = 0; run < count; ++run) {
    results.push_back(result_with(run, error_of_run(run)));
  }
  return results;
}

StatedRequirement stated(const std::string& requirement) {
  return {.id = "R", .text = "", .requirement = requirement};
}

// check_requirement() sorts all errors; the rows must say the same without keeping them.
TEST(MatrixPasses, AgreeWithTheErrorsThemselves) {
  for (const std::uint64_t count : {1U, 45U, 100U, 3000U}) {
    const std::string text = "a_c12 < 0.2 for 90% with 90%";
    const std::vector<RunResult> results = some_results(count);
    std::vector<double> errors;
    for (const RunResult& result : results) errors.push_back(std::abs(result.error(a_c12)));
    const RequirementCheck expected = check_requirement(
        parse_requirement(text, quantity_names(model().results())), errors, 2, {});
    std::vector<RunResult> with_lost = results;
    for (std::uint64_t run = count; run < count + 2; ++run) {
      with_lost.push_back(
          test::zero_result({.run = {run}, .status = RunStatus::not_finite, .num_draws = 1}));
    }
    const MatrixRow row = rows_of({stated(text)}, with_lost)[0];
    EXPECT_EQ(row.answer.check.verdict, expected.verdict);
    EXPECT_EQ(row.answer.check.num_runs, expected.num_runs);
    EXPECT_EQ(row.answer.check.num_exceedances, expected.num_exceedances);
    EXPECT_EQ(row.answer.check.num_allowed, expected.num_allowed);
    ASSERT_EQ(row.bound.has_value(), expected.bound.has_value()) << count;
    if (row.bound) {
      EXPECT_EQ(*row.bound, expected.bound->value) << count;
    }
    EXPECT_EQ(row.worst->value, *std::ranges::max_element(errors));
  }
}

// The largest ratio of all parameters is that of the first one, whose objective is 1: the bound of
// all objectives together is that of its error.
TEST(MatrixPasses, BoundAllObjectivesTogetherByTheLargestRatio) {
  const std::vector<RunResult> results = some_results(500);
  const std::vector<MatrixRow> rows = rows_of(
      {stated("all objectives for 95% with 90%"), stated("a_c11_delta_x < 1 for 95% with 90%")},
      results);
  EXPECT_EQ(rows[0].limit, 1.0);
  EXPECT_EQ(rows[0].bound, rows[1].bound);
  EXPECT_EQ(rows[0].worst->run.value, rows[1].worst->run.value);
  EXPECT_EQ(rows[0].relative_margin(), 1.0 - *rows[0].bound);
}

// A requirement is met if and only if the bound is below the limit.
TEST(MatrixPasses, MeetARequirementWithAMargin) {
  for (const double limit : {0.3, 0.44, 0.46, 0.47, 0.48, 0.49, 0.6}) {
    const MatrixRow row =
        rows_of({stated("a_c11_delta_z < " + std::to_string(limit) + " for 95% with 90%")},
                some_results(400))[0];
    EXPECT_EQ(row.answer.check.verdict == Verdict::met, *row.relative_margin() > 0.0) << limit;
  }
}

TEST(MatrixPasses, CountRunsThatWereGivenUp) {
  const MatrixRow row = rows_of({stated("k2c < 10 for 95% with 90%")}, some_results(60), 3)[0];
  EXPECT_EQ(row.answer.check.num_runs, 63U);
  EXPECT_EQ(row.answer.check.num_exceedances, 3U);
  EXPECT_EQ(row.answer.check.num_without_estimate, 3U);
}

TEST(MatrixPasses, HaveNoFiguresOfNoRuns) {
  const MatrixRow row = rows_of({stated("k2c < 10 for 95% with 90%")}, {})[0];
  EXPECT_EQ(row.bound, std::nullopt);
  EXPECT_FALSE(row.worst.has_value());
  EXPECT_EQ(row.relative_margin(), std::nullopt);
}

TEST(MatrixRequirements, AreTheObjectivesIfThereAreNone) {
  std::vector<double> objectives = ones();
  objectives[a_c12] = std::numeric_limits<double>::infinity();
  objectives[0] = 1.0 / 3.0;
  const std::vector<StatedRequirement> requirements = matrix_requirements({}, objectives);
  ASSERT_EQ(requirements.size(), num_parameters);  // One less, and all together.
  EXPECT_EQ(requirements[0].requirement, "a_c11_delta_x < 0.3333333333333333 for 95% with 90%");
  EXPECT_EQ(parse_requirement(requirements[0].requirement, quantity_names(model().results())).limit,
            objectives[0]);
  EXPECT_EQ(requirements.back().requirement, "all objectives for 95% with 90%");
}

TEST(MatrixRequirements, EndWithAllObjectivesTogether) {
  const std::vector<double> objectives = ones();
  const auto two = matrix_requirements(
      {stated("all objectives for 99% with 95%"), stated("k2c < 1 for 9% with 9%")}, objectives);
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[1].requirement, "all objectives for 99% with 95%");
  EXPECT_EQ(matrix_requirements({stated("k2c < 1 for 9% with 9%")}, objectives).size(), 2U);
  const std::vector<double> none(num_parameters, std::numeric_limits<double>::infinity());
  EXPECT_TRUE(matrix_requirements({}, none).empty());
}

// Of 100 runs 2 may exceed 0.95 with 0.9 if their number was fixed, else 0; the bound goes with it.
TEST(MatrixPasses, BoundByTheRuleOfTheirVerdict) {
  const std::vector<StatedRequirement> one{stated("a_c12 < 0.6 for 95% with 90%")};
  const std::vector<RunResult> results = some_results(100);
  const MatrixRow fixed = rows_of(one, results, 0, 100)[0];
  const MatrixRow open = rows_of(one, results)[0];
  EXPECT_TRUE(fixed.answer.check.is_of_fixed_size);
  EXPECT_FALSE(open.answer.check.is_of_fixed_size);
  EXPECT_GT(fixed.answer.check.num_allowed, open.answer.check.num_allowed);
  EXPECT_LT(*fixed.bound, *open.bound);
}

}  // namespace
}  // namespace proofmass::coordinator
