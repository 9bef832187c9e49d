#include "coordinator/archive/comparison.hpp"

#include <nlohmann/json.hpp>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/statistics/error_change.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// A campaign with its results.
struct Side {
  MicroscopeCampaign campaign;
  std::string model_version = "model";
  std::string build = "build";
  std::vector<Quantity> quantities = test::schema().quantities;
  std::vector<RunResult> results = {};
};

ComparedCampaign compared(const Side& side) {
  return {.campaign = side.campaign.clone(),
          .quantities = side.quantities,
          .model_version = side.model_version,
          .build = side.build,
          .open_results = [results = side.results] {
            return [&results, next = std::size_t{0}]() mutable -> std::optional<RunResult> {
              if (next == results.size()) return std::nullopt;
              return results[next++];
            };
          }};
}

CampaignComparison compare_campaigns(const Side& first, const Side& second) {
  std::vector<ComparedCampaign> members(2);
  members[1].comparison = coordinator::compare_campaigns(compared(first), compared(second));
  adjust_together(members);
  return *members[1].comparison;
}

/// Runs [0, count), whose error of parameter i is ±(i + 1)·(run + 1), by turns.
Side side(std::uint64_t count) {
  Side side{.campaign = test::campaign_of(count)};
  for (std::uint64_t run = 0; run < count; ++run) {
    RunResult result = test::zero_result({.run = RunIndex{run}, .num_draws = 1, .num_rounds = 2});
    for (std::size_t i = 0; i < num_parameters; ++i) {
      result.truth[i] = static_cast<double>(run * i);
      const double error = static_cast<double>((i + 1) * (run + 1));
      result.estimate[i] = result.truth[i] + (run % 2 == 0 ? error : -error);
    }
    side.results.push_back(result);
  }
  return side;
}

/// Makes the |error| of a parameter larger by `change`·(run + 1).
void worsen(Side& side, Parameter parameter, double change) {
  for (RunResult& result : side.results) {
    const double larger = change * static_cast<double>(result.run.value + 1);
    result.estimate[index(parameter)] += std::copysign(larger, result.error(index(parameter)));
  }
}

/// A comparison as `compare` holds it, of campaigns whose statistics do not matter.
std::vector<ComparedCampaign> both(const CampaignComparison& comparison) {
  std::vector<ComparedCampaign> members(2);
  members[0].file = "a.db";
  members[1].file = "b.db";
  members[1].comparison = comparison;
  members[0].results.statistics.num_estimated = comparison.first.num_estimated;
  members[1].results.statistics.num_estimated = comparison.second.num_estimated;
  for (ComparedCampaign& member : members) {
    member.campaign = test::campaign_of(1).clone();
    member.quantities = test::schema().quantities;
    member.results.statistics.accuracy.resize(num_parameters);
  }
  return members;
}

std::string text_of(const CampaignComparison& comparison) {
  return comparison_text(both(comparison), lettered(2));
}

// Errors of a_c12 are 4, −8, 12 and −16 in the first campaign, 4.5, −9, 13.5 and −18 in the second;
// everything follows by hand.
TEST(Comparison, OfPairsIsRunByRun) {
  const Side first = side(4);
  Side second = side(4);
  worsen(second, Parameter::a_c12, 0.5);
  const CampaignComparison comparison = compare_campaigns(first, second);
  EXPECT_TRUE(comparison.is_paired());
  EXPECT_EQ(comparison.why_not_compared, "");
  EXPECT_EQ(comparison.first.num_estimated, 4U);
  EXPECT_EQ(comparison.second.num_estimated, 4U);
  EXPECT_TRUE(comparison.differences.empty());
  const ParameterComparison& changed = comparison.parameters[index(Parameter::a_c12)];
  EXPECT_EQ(changed.first.bias, -2.0);
  EXPECT_EQ(changed.second.bias, -2.25);
  EXPECT_EQ(changed.first.mean, 10.0);
  EXPECT_EQ(changed.second.mean, 11.25);
  EXPECT_EQ(changed.first.worst, 16.0);
  EXPECT_EQ(changed.second.worst, 18.0);
  EXPECT_NEAR(changed.first.standard_deviation, std::sqrt(464.0 / 3.0), 1e-13);
  EXPECT_NEAR(changed.tail_limit, 2.0 * std::sqrt((480.0 + 607.5) / 8.0), 1e-13);
  EXPECT_EQ(changed.second.num_in_tail, 0U);
  ASSERT_TRUE(changed.bias_interval.has_value());
  // Student's quantile for 3 degrees of freedom, from tables; the changes are 0.5, -1, 1.5 and -2.
  const double half_width = 3.182446 * std::sqrt(7.25 / 3.0) / 2.0;
  EXPECT_NEAR(changed.bias_interval->lower, -0.25 - half_width, 1e-6);
  EXPECT_NEAR(changed.bias_interval->upper, -0.25 + half_width, 1e-6);
  EXPECT_EQ(changed.p_values.location, 0.875) << "14 of the 2⁴ choices of signs";
  // Distances from the mean grow by 0.75, 0.75, 1.75 and 1.75: ranks 1.5, 1.5, 3.5 and 3.5.
  EXPECT_NEAR(changed.p_values.scale, std::erfc(5.0 / std::sqrt(7.25) / std::sqrt(2.0)), 1e-14);
  EXPECT_EQ(changed.p_values.tail, 1.0);
  EXPECT_EQ(changed.adjusted_p_values.scale, 1.0) << "fifty times that, at most 1";
  const ParameterComparison& same = comparison.parameters[index(Parameter::k2d)];
  EXPECT_EQ(same.first.bias, same.second.bias);
  EXPECT_EQ(same.p_values.location, 1.0);
  EXPECT_EQ(same.p_values.scale, 1.0);
}

// Scale has a weight of 0.4, and those of all tests add up to 10.
TEST(Comparison, FindsASmallChangeOfManyRunsAndCorrectsForThreeTestsOfTenParameters) {
  const Side first = side(40);
  Side second = side(40);
  worsen(second, Parameter::a_c12, 1e-3);
  const CampaignComparison comparison = compare_campaigns(first, second);
  const ParameterComparison& changed = comparison.parameters[index(Parameter::a_c12)];
  EXPECT_LT(changed.p_values.scale, 1e-6);
  EXPECT_NEAR(changed.adjusted_p_values.scale, 25.0 * changed.p_values.scale,
              1e-12 * changed.p_values.scale);
}

// Holm's method over both comparisons: the smallest of their 2·30 p-values is multiplied by the
// weights of all, 2·10 (of 0.5, 0.4 and 0.1 for each parameter), over its own, 0.4.
TEST(Comparison, CorrectsForAllCampaignsTogether) {
  Side third = side(40);
  worsen(third, Parameter::a_c12, 1e-3);
  std::vector<ComparedCampaign> members(3);
  members[1].comparison = coordinator::compare_campaigns(compared(side(40)), compared(side(40)));
  members[2].comparison = coordinator::compare_campaigns(compared(side(40)), compared(third));
  adjust_together(members);
  const ParameterComparison& changed = members[2].comparison->parameters[index(Parameter::a_c12)];
  EXPECT_NEAR(changed.adjusted_p_values.scale / changed.p_values.scale, 50.0, 1e-9);
  for (const ParameterComparison& parameter : members[1].comparison->parameters) {
    EXPECT_EQ(parameter.adjusted_p_values.scale, 1.0);
  }
}

/// Runs whose errors of all parameters are normal, and of a_c13 with a bias.
Side normal_side(std::uint64_t seed, double bias) {
  constexpr std::uint64_t num_runs = 150;
  Side normal = side(num_runs);
  normal.campaign.seed = seed;
  for (std::uint32_t i = 0; i < num_parameters; ++i) {
    const auto errors =
        test::normal_column(num_runs, {.seed = 91, .repetition = seed, .column = i});
    const double shift = i == index(Parameter::a_c13) ? bias : 0.0;
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      normal.results[run].truth[i] = 0.0;
      normal.results[run].estimate[i] = errors[run] + shift;
    }
  }
  return normal;
}

// The bias makes |error| larger by a tenth, within its scatter.
TEST(Comparison, FindsABiasWhetherRunsArePairedOrNot) {
  const CampaignComparison unpaired = compare_campaigns(normal_side(1, 0.0), normal_side(2, 0.6));
  const CampaignComparison paired = compare_campaigns(normal_side(1, 0.0), normal_side(1, 0.01));
  EXPECT_FALSE(unpaired.is_paired());
  EXPECT_TRUE(paired.is_paired());
  for (const CampaignComparison& comparison : {unpaired, paired}) {
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const ChangePValues& p = comparison.parameters[i].adjusted_p_values;
      EXPECT_EQ(p.location < 0.05, i == index(Parameter::a_c13)) << i;
      EXPECT_GT(p.tail, 0.05) << i;
    }
  }
}

// The first campaign has runs 0 to 7, the second one has 1 to 4, of which run 2 has no estimate.
TEST(Comparison, CountsAllRunsAndTestsPairsAndTheOthersTogether) {
  const Side first = side(8);
  Side second = side(5);
  second.results.erase(second.results.begin());
  second.results[1].status = RunStatus::not_finite;
  const CampaignComparison comparison = compare_campaigns(first, second);
  EXPECT_TRUE(comparison.is_paired());
  EXPECT_EQ(comparison.first.num_estimated, 8U);
  EXPECT_EQ(comparison.second.num_estimated, 3U);
  EXPECT_EQ(comparison.num_pairs, 3U);
  EXPECT_EQ(comparison.first.num_tested, 4U) << "not run 2, which the second campaign has lost";
  EXPECT_EQ(comparison.second.num_tested, 0U);
  const ParameterComparison& parameter = comparison.parameters[0];
  EXPECT_DOUBLE_EQ(parameter.first.mean, 4.5);
  EXPECT_DOUBLE_EQ(parameter.second.mean, (2.0 + 4.0 + 5.0) / 3.0);
  EXPECT_DOUBLE_EQ(parameter.first.bias, -0.5);
  EXPECT_DOUBLE_EQ(parameter.second.bias, -1.0 / 3.0);
  EXPECT_EQ(parameter.bias_change, 0.0) << "of the pairs";
  const ChangePValues expected =
      compare_errors(std::vector<double>{1, -6, 7, -8}, std::vector<double>{-2, -4, 5});
  EXPECT_EQ(parameter.p_values.location, std::min(1.0, 2.0 * expected.location));
  EXPECT_EQ(parameter.p_values.scale, std::min(1.0, 2.0 * expected.scale));
  EXPECT_EQ(parameter.p_values.tail, std::min(1.0, 2.0 * expected.tail));
  EXPECT_THAT(
      text_of(comparison),
      HasSubstr("5 runs of A were not computed in B or, 1 of them, have no estimate there: "
                "they\n  count in bias, std and tail, not in change; the 4 not computed are "
                "tested as a\n  whole, and p is twice the smaller of both tests\n"));
}

// Fewer than the pairs would cost these more than they tell.
TEST(Comparison, LeavesFewOthersOutOfTheTests) {
  const CampaignComparison comparison = compare_campaigns(side(4), side(7));
  EXPECT_EQ(comparison.second.num_tested, 0U);
  for (const ParameterComparison& parameter : comparison.parameters) {
    EXPECT_EQ(parameter.p_values.scale, 1.0);
  }
  EXPECT_EQ(comparison.parameters[0].second.mean, 4.0);
  EXPECT_THAT(text_of(comparison),
              HasSubstr("3 runs of B were not computed in A: they count in bias, std and tail, not "
                        "in\n  change; they are in no test\n"));
}

// 30 pairs without a change, and 120 further runs of the second campaign that scatter three times
// as much; which campaign is named first makes no difference.
TEST(Comparison, FindsAScatterOfRunsThatOnlyOneCampaignHas) {
  Side first = normal_side(1, 0.0);
  first.results.resize(30);
  Side second = normal_side(1, 0.0);
  for (RunResult& result : second.results) {
    if (result.run.value < 30) continue;
    for (double& estimate : result.estimate) estimate *= 3.0;
  }
  for (const CampaignComparison& comparison :
       {compare_campaigns(first, second), compare_campaigns(second, first)}) {
    EXPECT_EQ(comparison.num_pairs, 30U);
    for (const ParameterComparison& parameter : comparison.parameters) {
      EXPECT_LT(parameter.adjusted_p_values.scale, 0.05);
      EXPECT_GT(parameter.adjusted_p_values.location, 0.05);
      EXPECT_EQ(parameter.bias_change, 0.0);
    }
  }
}

TEST(Comparison, OfOtherSeedsIsOfAllRuns) {
  const Side first = side(7);
  Side second = side(5);
  second.campaign.seed = 2;
  const CampaignComparison comparison = compare_campaigns(first, second);
  EXPECT_EQ(comparison.why_unpaired, "the seeds differ");
  EXPECT_EQ(comparison.first.num_estimated, 7U);
  EXPECT_EQ(comparison.second.num_estimated, 5U);
  const ParameterComparison& parameter = comparison.parameters[1];
  EXPECT_EQ(parameter.first.mean, 8.0);
  EXPECT_EQ(parameter.second.mean, 6.0);
  EXPECT_DOUBLE_EQ(parameter.first.bias, 8.0 / 7.0);
  EXPECT_DOUBLE_EQ(parameter.second.bias, 6.0 / 5.0);
  const std::vector<double> of_first{2, -4, 6, -8, 10, -12, 14}, of_second{2, -4, 6, -8, 10};
  const ChangePValues expected = compare_errors(of_first, of_second);
  EXPECT_EQ(parameter.p_values.location, expected.location);
  EXPECT_EQ(parameter.p_values.scale, expected.scale);
  EXPECT_EQ(parameter.p_values.tail, expected.tail);
  ASSERT_EQ(comparison.differences.size(), 1U);
  EXPECT_EQ(comparison.differences[0].field, "seed");
  EXPECT_EQ(comparison.differences[0].first, "1");
  EXPECT_EQ(comparison.differences[0].second, "2");
}

// Two errors that lie close together by chance, at a tenth of the others' range: their deviation
// says nothing. With the scatter of all 252, Student's law has 5.2 % of cases as far apart (scipy's
// ttest_ind with equal_var); Welch's test takes it for 5e-60.
TEST(Comparison, OfTwoRunsFindsNoChange) {
  Side second = side(2);
  second.campaign.seed = 2;
  for (RunResult& result : second.results) {
    for (std::size_t i = 0; i < num_parameters; ++i) {
      const double error = 25.2 + 0.1 * static_cast<double>(result.run.value);
      result.estimate[i] = result.truth[i] + static_cast<double>(i + 1) * error;
    }
  }
  const CampaignComparison comparison = compare_campaigns(side(250), second);
  for (const ParameterComparison& parameter : comparison.parameters) {
    EXPECT_NEAR(parameter.p_values.scale, 0.0521784414265832, 1e-12);
    EXPECT_GT(parameter.adjusted_p_values.location, 0.05);
    EXPECT_GT(parameter.adjusted_p_values.scale, 0.05);
    EXPECT_GT(parameter.adjusted_p_values.tail, 0.05);
  }
}

TEST(Comparison, OfOtherDrawsIsOfAllRuns) {
  const Side first = side(4);
  Side second = side(4);
  second.results[2].truth[9] = std::nextafter(second.results[2].truth[9], 99.0);
  EXPECT_EQ(compare_campaigns(first, second).why_unpaired, "the draws of run 2 differ");
  second = side(4);
  second.results[3].status = RunStatus::no_draw;
  EXPECT_EQ(compare_campaigns(first, second).why_unpaired, "the draws of run 3 differ");
}

TEST(Comparison, WithoutACommonRunIsOfAllRuns) {
  const Side all = side(6);
  Side first = all, second = all;
  first.results.resize(3);
  second.results.erase(second.results.begin(), second.results.begin() + 3);
  EXPECT_EQ(compare_campaigns(first, second).why_unpaired, "no run is finished in both");
}

TEST(Comparison, OfTooFewRunsIsOfTheDefinitionsAlone) {
  Side first = side(5), second = side(1);
  second.campaign.seed = 2;
  EXPECT_EQ(compare_campaigns(first, second).why_not_compared,
            "5 and 1 runs with an estimate (must be at least 2)");
  first = second = side(1);
  EXPECT_EQ(compare_campaigns(first, second).why_not_compared,
            "one run has an estimate in both (must be at least 2)");
  first = second = side(2);
  for (RunResult& result : second.results) result.status = RunStatus::not_finite;
  const CampaignComparison comparison = compare_campaigns(first, second);
  EXPECT_EQ(comparison.why_not_compared, "no run has an estimate in both");
  EXPECT_THAT(text_of(comparison),
              HasSubstr("cannot be compared: no run has an estimate in both\n"));
}

TEST(Comparison, NamesOtherModelsAndBuilds) {
  const Side first = side(2);
  Side second = side(2);
  second.model_version = "other model";
  second.build = "other build";
  second.campaign.scenario.noise.scale = 2.0;
  const auto differences = compare_campaigns(first, second).differences;
  ASSERT_EQ(differences.size(), 3U);
  EXPECT_EQ(differences[0].field, "noise.scale");
  EXPECT_EQ(differences[1].field, "model");
  EXPECT_EQ(differences[1].second, "other model");
  EXPECT_EQ(differences[2].field, "build");
}

using ComparedFile = test::StoreTest;

TEST_F(ComparedFile, IsReadWithAllThatCountsAndHeldAgainstItsDigest) {
  const MicroscopeCampaign campaign = test::campaign_of(9);
  {
    Store store = test::store_of(file(), campaign, test::results_of_each_status(5));
    const Entry given_up = GivenUpRun{.run = RunIndex{7}};
    (void)store.write({&given_up, 1});
    update_statistics(store, campaign);
  }
  const std::vector<std::filesystem::path> files{file(), file()};
  for (const ComparedCampaign& member : compare_several(files, test::never_stopped)) {
    EXPECT_EQ(member.campaign->num_runs, 9U);
    EXPECT_EQ(member.results.statistics.num_estimated, 2U);
    EXPECT_EQ(
        member.results.missing,
        (MissingEstimates{
            .num_not_converged = 1, .num_not_finite = 1, .num_no_draw = 1, .num_given_up = 1}));
  }
  EXPECT_THROW((void)compare_several(files, test::stopped_at_once), Interrupted);
  test::change(file(), "UPDATE run_result SET num_rounds = num_rounds + 1 WHERE run_index = 0");
  EXPECT_THAT(test::error_of([&] { (void)compare_several(files, test::never_stopped); }),
              HasSubstr("the digest of its 5 results is "));
}

// Where slow runs have other errors, those that are finished behind them are a selection.
TEST_F(ComparedFile, EndsBeforeTheFirstRunThatIsMissing) {
  const MicroscopeCampaign campaign = test::campaign_of(9);
  std::vector<RunResult> results = side(7).results;
  results.erase(results.begin() + 3, results.begin() + 5);
  (void)test::store_of(file(), campaign, results);
  const std::vector<std::filesystem::path> files{file(), file()};
  const std::vector<ComparedCampaign> members = compare_several(files, test::never_stopped);
  EXPECT_EQ(members[1].comparison->num_pairs, 3U);
  EXPECT_EQ(members[1].comparison->first.num_estimated, 3U);
  EXPECT_THAT(comparison_text(members, lettered(2)),
              HasSubstr("Left out of B: 2 runs after the first that is missing."));
}

TEST(Letters, GoOnWithTwoAfterZ) {
  const MemberNames names = lettered(703);
  EXPECT_EQ(names.names[0], "A");
  EXPECT_EQ(names.names[25], "Z");
  EXPECT_EQ(names.names[26], "AA");
  EXPECT_EQ(names.names[701], "ZZ");
  EXPECT_EQ(names.names[702], "AAA");
}

TEST(ComparisonText, CountsTheRunsThatItLeavesOut) {
  std::vector<ComparedCampaign> members = both(compare_campaigns(side(8), side(6)));
  members[1].results.missing = {.num_not_finite = 2, .num_given_up = 1};
  EXPECT_THAT(comparison_text(members, lettered(2)),
              HasSubstr("6 runs of the same draws\n"
                        "Left out of B, without an estimate: 2 not finite, 1 given up.\n"));
  const auto json = comparison_json(members);
  EXPECT_EQ(json["num_first_without_estimate"], 0);
  EXPECT_EQ(json["num_second_without_estimate"], 3);
  EXPECT_THAT(comparison_text(members, lettered(2)), ::testing::Not(HasSubstr("are selected")));
  // Of 0 of 8 and 40 of 46 scipy says 2.886e-6.
  members[1].results.missing = {.num_lost = 40};
  EXPECT_THAT(comparison_text(members, lettered(2)),
              HasSubstr("A and B lack estimates not equally often (p 2.9e-06,"));
  std::swap(members[0].results.missing, members[1].results.missing);
  EXPECT_THAT(comparison_text(members, lettered(2)), HasSubstr("not equally often"));
}

}  // namespace
}  // namespace proofmass::coordinator
