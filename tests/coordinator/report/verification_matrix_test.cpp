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

std::vector<RequirementAnswer> answers_to(const std::vector<StatedRequirement>& stated,
                                          const std::vector<RunResult>& results,
                                          std::uint64_t num_given_up = 0,
                                          std::optional<std::uint64_t> num_fixed = {}) {
  VerificationMatrix matrix(stated, ones(), num_given_up, num_fixed);
  for (const RunResult& result : results) matrix.add(result);
  for (std::size_t i = 0; i < num_parameters; ++i) {
    std::vector<double> magnitudes;
    for (const RunResult& result : results) {
      if (result.is_completed()) magnitudes.push_back(std::abs(result.error(i)));
    }
    std::ranges::sort(magnitudes);
    matrix.add_magnitudes(i, magnitudes);
  }
  return matrix.answers();
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

// Two runs have no estimate: the bound is that of as many errors that are larger than any.
TEST(VerificationMatrix, AgreesWithTheErrorsThemselves) {
  for (const std::uint64_t count : {1U, 45U, 100U, 3000U}) {
    std::vector<RunResult> results = some_results(count);
    std::vector<double> errors;
    for (const RunResult& result : results) errors.push_back(std::abs(result.error(a_c12)));
    for (std::uint64_t run = count; run < count + 2; ++run) {
      results.push_back(
          test::zero_result({.run = {run}, .status = RunStatus::not_finite, .num_draws = 1}));
    }
    const auto num_above = std::ranges::count_if(errors, [](double e) { return e >= 0.2; });
    const RequirementAnswer answer =
        answers_to({stated("a_c12 < 0.2 for 90% with 90%")}, results, 0, count + 2)[0];
    EXPECT_EQ(answer.check.num_runs, count + 2);
    EXPECT_EQ(answer.check.num_exceedances, static_cast<std::uint64_t>(num_above) + 2);
    EXPECT_EQ(answer.bound, wilks_upper(errors, {0.9, 0.9}, 2)) << count;
    EXPECT_EQ(answer.worst->value, *std::ranges::max_element(errors));
  }
}

// The largest ratio of all parameters is that of the first one, whose objective is 1: the bound of
// all objectives together is that of its error.
TEST(VerificationMatrix, BoundsAllObjectivesTogetherByTheLargestRatio) {
  const std::vector<RunResult> results = some_results(500);
  const std::vector<RequirementAnswer> rows = answers_to(
      {stated("all objectives for 95% with 90%"), stated("a_c11_delta_x < 1 for 95% with 90%")},
      results);
  EXPECT_EQ(rows[0].limit, 1.0);
  EXPECT_EQ(rows[0].bound, rows[1].bound);
  EXPECT_EQ(rows[0].worst->run.value, rows[1].worst->run.value);
  EXPECT_EQ(rows[0].relative_margin(), 1.0 - *rows[0].bound);
}

// A requirement is met if and only if the bound is below the limit.
TEST(VerificationMatrix, MeetsARequirementWithAMargin) {
  for (const double limit : {0.3, 0.44, 0.46, 0.47, 0.48, 0.49, 0.6}) {
    const RequirementAnswer row =
        answers_to({stated("a_c11_delta_z < " + std::to_string(limit) + " for 95% with 90%")},
                   some_results(400))[0];
    EXPECT_EQ(row.check.verdict == RequirementVerdict::met, *row.relative_margin() > 0.0) << limit;
  }
}

TEST(VerificationMatrix, CountsRunsThatWereGivenUp) {
  const RequirementAnswer row =
      answers_to({stated("k2c < 10 for 95% with 90%")}, some_results(60), 3)[0];
  EXPECT_EQ(row.check.num_runs, 63U);
  EXPECT_EQ(row.check.num_exceedances, 3U);
  EXPECT_EQ(row.check.num_without_estimate, 3U);
}

TEST(VerificationMatrix, HasNoFiguresOfNoRuns) {
  const RequirementAnswer row = answers_to({stated("k2c < 10 for 95% with 90%")}, {})[0];
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
TEST(VerificationMatrix, BoundsByTheRuleOfItsVerdict) {
  const std::vector<StatedRequirement> one{stated("a_c12 < 0.6 for 95% with 90%")};
  const std::vector<RunResult> results = some_results(100);
  const RequirementAnswer fixed = answers_to(one, results, 0, 100)[0];
  const RequirementAnswer open = answers_to(one, results)[0];
  EXPECT_TRUE(fixed.check.is_of_fixed_size);
  EXPECT_FALSE(open.check.is_of_fixed_size);
  EXPECT_GT(fixed.check.num_allowed, open.check.num_allowed);
  EXPECT_LT(*fixed.bound, *open.bound);
}

}  // namespace
}  // namespace proofmass::coordinator
