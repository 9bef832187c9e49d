#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include "coordinator/report/read_results.hpp"
#include "coordinator/report/requirements.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/table/table.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

MATCHER(FitsATerminal, "has at most 80 characters") { return display_width(arg) <= 80; }

// Tables as lines of a terminal.

/// What is seen of a campaign with these statistics.
Review review_of(const Campaign& campaign, const CampaignStatistics& statistics,
                 std::uint64_t num_given_up = 0) {
  Review review{.name = "hardy2013",
                .seed = 1,
                .num_runs = 100,
                .num_runs_fixed = statistics.num_runs + num_given_up,
                .schema = test::schema(),
                .objectives = campaign.objectives(),
                .budget = campaign.error_budget()};
  review.results.statistics = statistics;
  review.results.missing.num_given_up = num_given_up;
  return review;
}

std::string accuracy_text(const Review& review) { return terminal_text(accuracy_table(review)); }
std::string interval_text(const Review& review) { return terminal_text(interval_table(review)); }
std::string error_text(const Review& review) { return terminal_text(error_table(review)); }

/// Statistics with the paper's own errors and `num_runs` runs, all of them estimated.
CampaignStatistics paper_statistics(std::uint64_t num_runs) {
  CampaignStatistics statistics;
  statistics.accuracy.resize(num_parameters);
  statistics.num_runs = num_runs;
  statistics.num_estimated = num_runs;
  for (const test::ParameterInfo& info : test::parameter_infos()) {
    AccuracyStatistic& accuracy = statistics.accuracy[index(info.parameter)];
    accuracy.worst = info.published->worst;
    accuracy.mean = info.published->mean;
    accuracy.standard_deviation = info.published->standard_deviation;
    accuracy.beyond_objective = probability_interval(0.0, static_cast<double>(num_runs), 0.95);
  }
  statistics.num_within_objectives = num_runs;
  return statistics;
}

TEST(GivenUpRuns, AreNamed) {
  EXPECT_EQ(given_up_text({}), "");
  const std::vector<RunRange> runs{{{17}, 1}, {{40}, 3}};
  EXPECT_EQ(given_up_text(runs), "          4 given up, having crashed: 17 40..42\n");
}

TEST(GivenUpRuns, AreNamedAsFarAsTheLineHasRoom) {
  std::vector<RunRange> runs;
  for (std::uint64_t run = 100'000'000; run < 100'000'100; run += 2) runs.push_back({{run}, 1});
  const std::vector<std::string> lines = lines_of(given_up_text(runs));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_THAT(lines[0], FitsATerminal());
  EXPECT_THAT(lines[0], testing::EndsWith(" 100000004 ..."));
}

// Documents have room for the run, and for figures in full.
TEST(AccuracyTable, NamesTheWorstRunAndMarksWhatIsBeyondItsObjective) {
  CampaignStatistics statistics = paper_statistics(100);
  AccuracyStatistic& accuracy = statistics.accuracy[index(Parameter::a_c13)];
  accuracy.num_beyond_objective = 3;
  accuracy.worst_run = {57};
  const Table table = accuracy_table(review_of(MicroscopeCampaign{}, statistics));
  const Row& row = table.rows[index(Parameter::a_c13)];
  EXPECT_EQ(row[1].in_document(), "10⁻⁴ rad");
  EXPECT_EQ(row[3].value, 11e-4);
  EXPECT_EQ(row[4].text, "57");
  EXPECT_EQ(row[7].tone, Tone::bad);
  EXPECT_EQ(table.rows[index(Parameter::a_c12)][7].tone, Tone::plain);
}

// 21.2 nm ± 104.2 nm by Student's law with one degree of freedom: no mean |error| is below 0.
TEST(IntervalTable, BeginsAtZeroWhereAMagnitudeDoes) {
  CampaignStatistics statistics = paper_statistics(2);
  AccuracyStatistic& accuracy = statistics.accuracy[index(Parameter::a_c11_delta_x)];
  accuracy.mean_interval = Interval{.lower = -83.0e-9, .upper = 125.4e-9, .confidence = 0.95};
  EXPECT_THAT(lines_of(interval_text(review_of(MicroscopeCampaign{}, statistics))),
              Contains("a_c11·Δx       10.0       0     125 │    7.30       -       - │"
                       "        0      -"));
}

TEST(IntervalTable, HasNoFiguresThatSoFewRunsDoNotGive) {
  const Review review = review_of(MicroscopeCampaign{}, paper_statistics(1));
  EXPECT_THAT(lines_of(interval_text(review)),
              Contains("a_c11·Δx       10.0       -       - │       -       -       - │"
                       "        0      -"));
  EXPECT_THAT(accuracy_text(review), HasSubstr(" of 1 run\n"));
  EXPECT_THAT(lines_of(accuracy_text(review)),
              Contains("a_c11·Δx   nm             100    40.0    10.0       -      0 │"
                       "    40    10   7.3"));
}

// Nothing is beyond an objective that there is not, and nothing within.
TEST(ErrorTable, CountsNothingBeyondAnObjectiveThatThereIsNot) {
  Review review = review_of(MicroscopeCampaign{}, paper_statistics(100));
  review.objectives[0] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(
      lines_of(accuracy_text(review)),
      Contains(::testing::MatchesRegex("a_c11·Δx   nm  +-  +40.0  +10.0  +[0-9.]+ +- │.*")));
  EXPECT_THAT(lines_of(error_text(review)),
              Contains(::testing::MatchesRegex("a_c11·Δx .* +-  +-")));
}

// A requirement counts them; the intervals of this table cannot.
TEST(ErrorTable, SaysThatItLeavesOutDrawsWithoutAnEstimate) {
  CampaignStatistics statistics = paper_statistics(100);
  EXPECT_THAT(error_text(review_of(MicroscopeCampaign{}, statistics)),
              ::testing::Not(HasSubstr("beyond: ")));
  statistics.num_estimated = 60;
  Review review = review_of(MicroscopeCampaign{}, statistics, 3);
  EXPECT_THAT(error_text(review), HasSubstr("beyond: of draws that have an estimate; 43 of 103 "));
  std::ranges::fill(review.objectives, std::numeric_limits<double>::infinity());
  EXPECT_THAT(error_text(review), ::testing::Not(HasSubstr("beyond: ")));
}

// Of 100 errors of 0.1 but for two of −4.9, whose law has the mean 0: t is large, the skewness
// −6.9.
TEST(ErrorTable, NamesNoBiasOfErrorsThatAreTooSkewed) {
  CampaignStatistics statistics = paper_statistics(100);
  for (const Parameter parameter : {Parameter::a_c12, Parameter::k2c}) {
    ErrorStatistic& error = statistics.accuracy[index(parameter)].error;
    error.bias = 1.0;
    error.standard_deviation = 1.0;
    error.skewness = parameter == Parameter::k2c ? -6.9 : 0.5;
  }
  EXPECT_THAT(error_text(review_of(MicroscopeCampaign(), statistics)),
              ::testing::AllOf(HasSubstr("too skewed for\n  100 runs: K2c/K1c². Of all 10"),
                               HasSubstr("the bias differs from 0 of\n  a_c12.")));
}

// Intervals hold for a number of runs that no result has a part in.
TEST(ErrorTable, SaysThatTheNumberOfRunsWasNotFixed) {
  Review review = review_of(MicroscopeCampaign(), paper_statistics(100), 3);
  EXPECT_THAT(error_text(review), ::testing::Not(HasSubstr("fixed beforehand")));
  EXPECT_THAT(interval_text(review), ::testing::Not(HasSubstr("fixed beforehand")));
  for (const std::optional<std::uint64_t> fixed : {std::optional<std::uint64_t>(), {100}}) {
    review.num_runs_fixed = fixed;
    EXPECT_THAT(error_text(review), HasSubstr("runs fixed beforehand,\n  which 103 was not"));
    EXPECT_THAT(interval_text(review), HasSubstr("which 103 was not"));
  }
}

// √100/5 + 2√(6/100) = 2.49.
TEST(IntervalTable, NamesMeansThatAreTooSkewed) {
  CampaignStatistics statistics = paper_statistics(100);
  statistics.accuracy[index(Parameter::a_c12)].skewness = 2.48;
  const auto text = [&] { return interval_text(review_of(MicroscopeCampaign(), statistics)); };
  EXPECT_THAT(text(), ::testing::Not(HasSubstr("skewed")));
  statistics.accuracy[index(Parameter::k2c)].skewness = 2.5;
  EXPECT_THAT(text(), HasSubstr("mean, std: too skewed for intervals from 100 runs, which may "
                                "cover less than 95\n  %: K2c/K1c²\n"));
}

// A rule that stops where errors are small makes the worst one too small.
TEST(IntervalTable, ClaimsNothingOfTheWorstOneAfterAStop) {
  Review review = review_of(MicroscopeCampaign(), paper_statistics(100));
  EXPECT_THAT(interval_text(review), HasSubstr("worst of 100: with 95 % confidence 97.048 %"));
  review.stop.emplace();
  EXPECT_THAT(interval_text(review), ::testing::Not(HasSubstr("worst of")));
}

TEST(ErrorTable, HasNoColumnsOfIntervalsOfDrawsThatAreNotIndependent) {
  CampaignStatistics statistics = paper_statistics(40);
  leave_out_intervals(statistics);
  Review review = review_of(MicroscopeCampaign{}, statistics);
  review.why_not_independent = "4 runs share one draw";
  EXPECT_TRUE(interval_table(review).rows.empty());
  const std::string text = error_text(review);
  EXPECT_THAT(text, HasSubstr("no intervals over runs: 4 runs share one draw\n"
                              "all objectives together: 40 of 40 runs\n"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("from")));
  EXPECT_THAT(lines_of(text), Each(FitsATerminal()));
}

// The largest counts, the longest name and errors of any size.
TEST(Report, FitsATerminal) {
  constexpr std::uint64_t most = 1'000'000'000;
  CampaignStatistics statistics = paper_statistics(most);
  for (const double factor : {1e-90, 1e-6, 1.0, 1e6, 1e90}) {
    for (AccuracyStatistic& accuracy : statistics.accuracy) {
      accuracy.worst = accuracy.mean = accuracy.standard_deviation = 1.2345e-6 * factor;
      accuracy.num_beyond_objective = most;
      accuracy.mean_interval = accuracy.deviation_interval =
          Interval{.lower = 1.1111e-6 * factor, .upper = 1.3333e-6 * factor, .confidence = 0.95};
      accuracy.error.bias = -1.2345e-6 * factor;
      accuracy.error.bias_interval =
          Interval{.lower = -1.4e-6 * factor, .upper = -1.1e-6 * factor, .confidence = 0.95};
      for (PercentileStatistic& percentile : accuracy.percentiles) percentile.value = 1e-6 * factor;
      accuracy.error.skewness = -12.345;
    }
    MicroscopeCampaign campaign;
    for (double& objective : campaign.scenario.objectives) objective *= factor;
    Review review = review_of(campaign, statistics, most);
    review.results.totals = RunTotals{.worst_run = {most}};
    EXPECT_THAT(lines_of(accuracy_text(review)), Each(FitsATerminal()));
    EXPECT_THAT(lines_of(interval_text(review_of(campaign, statistics))), Each(FitsATerminal()));
    EXPECT_THAT(lines_of(error_text(review)), Each(FitsATerminal()));
    EXPECT_THAT(lines_of(terminal_text(budget_table(review))), Each(FitsATerminal()));
  }
  Review review = review_of(MicroscopeCampaign{}, statistics);
  review.name = std::string(64, 'n');
  review.seed = std::numeric_limits<std::uint64_t>::max();
  review.num_runs = most;
  review.results.digests.results = std::string(64, 'f');
  review.results.statistics.num_estimated = most / 4;
  review.results.missing = {
      .num_not_converged = most / 4, .num_not_finite = most / 4, .num_no_draw = most / 4};
  EXPECT_THAT(lines_of(summary_text(review)), Each(FitsATerminal()));
}

using StoredReport = test::StoreTest;

// Its square has no deviation, and a bootstrap of such deviations no end.
TEST_F(StoredReport, RefusesAnEstimateThatNoSimulationYields) {
  Store store = Store::create(file(), test::campaign_of(12), "");
  store.commit(test::deliveries_of(0, 12));
  test::change(file(), "UPDATE run_result SET estimate_k2d_s2_m = 1e200 WHERE run_index = 3");
  EXPECT_EQ(test::message_of<Error>([&] { (void)read_results(store, MicroscopeCampaign{}); }),
            "estimate_k2d_s2_m of run 3 = 1e+200 (must be in [-1e+90, 1e+90])");
}

// Run 1 has the worst total of all, and no run has the worst error of both parameters.
TEST_F(StoredReport, HasTheTotalsOfSingleRuns) {
  const MicroscopeCampaign campaign;
  Store store = Store::create(file(), test::campaign_of(4), "");
  EXPECT_FALSE(read_results(store, campaign).totals.has_value());
  std::vector<Delivery> deliveries = test::deliveries_of(0, 4);
  std::vector<double> totals;
  for (std::size_t run = 0; run < 3; ++run) {
    RunResult& result = deliveries[run].result;
    result.truth.assign(num_parameters, 0.0);
    result.estimate.assign(num_parameters, 0.0);
    result.estimate[index(Parameter::a_c12)] = run == 0 ? 1e-3 : 1e-5;
    result.estimate[index(Parameter::a_c13)] = run == 1 ? -2e-3 : 1e-5;
    result.health = test::values_of({.residual_m_s2 = 1e-10});
    totals.push_back(campaign.error_budget()->of_run(result).total);
  }
  deliveries[3].result.status = RunStatus::no_draw;
  store.commit(deliveries);
  const std::optional<RunTotals> of_runs = read_results(store, campaign).totals;
  EXPECT_EQ(of_runs->worst, totals[1]);
  EXPECT_EQ(of_runs->worst_run, RunIndex{1});
  EXPECT_EQ(of_runs->median, totals[0]);
}

// One of nine finished runs has no estimate, nor has the one that was given up.
TEST_F(StoredReport, CountsWhatWasGivenUpAsWithoutAnEstimate) {
  Store store = Store::create(file(), test::campaign_of(10), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 9);
  deliveries[4].result.status = RunStatus::no_draw;
  store.commit(deliveries);
  const Entry given_up = GivenUpRun{.run = {9}};
  store.write({&given_up, 1});
  EXPECT_THAT(report_text(read_review(store, MicroscopeCampaign{}, ReviewDepth::matrix)),
              HasSubstr("worst of 8: "));
  EXPECT_THAT(report_text(read_review(store, MicroscopeCampaign{}, ReviewDepth::matrix)),
              HasSubstr(" have an estimate; 2 more have none ("));
}

// Every number that is stored, as text of 17 digits, of results with errors that do not add up to
// the same in every order: 1e8 beside 1e-8.
TEST_F(StoredReport, IsTheSameBitsInWhateverOrderResultsCome) {
  std::vector<Delivery> deliveries = test::deliveries_of(0, 500);
  for (Delivery& delivery : deliveries) {
    const auto run = static_cast<double>(delivery.result.run.value);
    delivery.result.truth.assign(num_parameters, 0.0);
    delivery.result.estimate.assign(num_parameters,
                                    1e8 * std::sin(run) + 1e-8 * std::cos(1.7 * run));
  }
  const auto stored = [&](const std::string& name) {
    Store store = Store::create(file().replace_filename(name), test::campaign_of(500), "");
    for (const Delivery& delivery : deliveries) store.commit({&delivery, 1});
    update_statistics(store, MicroscopeCampaign{});
    const detail::Database database(file().replace_filename(name), detail::Access::read_only);
    std::string numbers = store.summary()->digests.results;
    for (const char* const table : {"statistic", "budget_entry"}) {
      const std::string columns =
          database.text(fmt::format("SELECT group_concat(printf('quote(%s)', name), '||') FROM "
                                    "pragma_table_info('{}')",
                                    table));
      numbers += database.text(fmt::format("SELECT group_concat({}) FROM {}", columns, table));
    }
    return numbers;
  };
  const std::string in_run_order = stored("ascending.db");
  EXPECT_GT(in_run_order.size(), 5000U);
  std::shuffle(deliveries.begin(), deliveries.end(), std::mt19937_64(3));
  EXPECT_EQ(stored("shuffled.db"), in_run_order);
}

/// What is said of so many runs, so many of them at 1e-3 and the others at 1e-4.
std::string answer_to(const std::string& text, std::size_t num_runs, std::size_t num_beyond) {
  RequirementAnswer answer;
  answer.stated.requirement = text;
  answer.requirement = test::parse_requirement(text);
  if (!answer.is_joint()) {
    answer.subject = requirement_subject(test::schema(), answer.requirement.parameter);
  }
  answer.check = check_requirement(answer.requirement,
                                   {.num_runs = num_runs, .num_exceedances = num_beyond}, num_runs);
  if (answer.check.bound_order > 0) {
    answer.bound = answer.check.bound_order <= num_beyond ? 1e-3 : 1e-4;
  }
  return requirement_text(answer);
}

// Bounds of proportions are those of Clopper and Pearson (scipy.stats.beta.ppf): 0.1 with 97 and 4
// is 93.44 %, 0.9 with 98 and 3 is 98.89 %. One in a hundred is as often as allowed: with 663 draws
// one may exceed the limit (sequential), and no number of draws decides. A bound that rounds to
// what is allowed has the digits that tell it apart: 1 − 0.05^(1/299) is 0.99691 %.
TEST(RequirementText, TellsBoundsAndHowManyDrawsDecide) {
  struct Case {
    std::string requirement;
    std::size_t num_runs;
    std::size_t num_beyond;
    std::string part;
  };
  const std::string fixed = "Rule         100 draws, a number fixed before the first result\n";
  const Case cases[] = {
      {"a_c12 < 9e-4 for 9% with 95%", 1'000'000, 909'905,
       "Exceeding    909905 of 1000000 runs; at least 90.94 % and at most 91.04 % of all\n"
       "             draws, each with 95 %\n"},
      {"a_c12 < 9e-4 for 99% with 95%", 100, 1,
       "Draws        663 meet the requirement if no further one exceeds the limit,\n"
       "             none decide if"},
      {"a_c12 < 9e-4 for 99.0031% with 95%", 299, 0,
       "at least 0 % and at most 0.99691 % of all draws,\n"},
      {"a_d11_prime < 9e-4 for 95% with 95%", 59, 0, " at most 0.0001, with 95 %\n"},
      {"all objectives for 95% with 90%", 100, 3,
       "Answer       undecided\n" + fixed +
           "Holding      97 of 100 runs; at least 93.44 % and at most 98.89 % of all draws,\n"
           "             each with 90 %\nRequired     95 % of all draws\nDraws        "},
      {"all objectives for 95% with 90%", 100, 3,
       " meet the requirement if no further one exceeds an objective,\n"},
      {"all objectives for 95% with 90%", 100, 3, " decide if they go on to exceed one as often\n"},
      {"all objectives for 90% with 90%", 100, 3,
       "Answer       met\n" + fixed +
           "Holding      97 of 100 runs; at least 93.44 % of all draws, with 90 %\n"}};
  for (const Case& of : cases) {
    EXPECT_THAT(answer_to(of.requirement, of.num_runs, of.num_beyond), testing::HasSubstr(of.part));
  }
}

using StoredRequirement = test::StoreTest;

// Seven of eleven runs meet every objective: one lacks an estimate, one was given up, one is beyond
// an objective, and another beyond two of them.
TEST_F(StoredRequirement, CountsRunsThatMissAnyObjectiveOnce) {
  Store store = Store::create(file(), test::campaign_of(11), "");
  const Entry given_up = GivenUpRun{.run = {10}};
  store.write({&given_up, 1});
  std::vector<Delivery> deliveries = test::deliveries_of(0, 10);
  for (Delivery& delivery : deliveries) delivery.result.estimate = delivery.result.truth;
  deliveries[4].result.status = RunStatus::no_draw;
  const std::vector<double> objectives = MicroscopeCampaign{}.objectives();
  const auto miss = [&](std::size_t run, Parameter parameter) {
    deliveries[run].result.estimate[index(parameter)] -= 2.0 * objectives[index(parameter)];
  };
  miss(2, Parameter::a_c12);
  miss(7, Parameter::k2c);
  miss(7, Parameter::a_c13);
  store.commit(deliveries);
  const std::vector<std::string> texts{"all objectives for 50% with 50%"};
  const RequirementAnswer answer =
      read_review(store, test::campaign_of(11), ReviewDepth::matrix, numbered_requirements(texts))
          .matrix[0];
  EXPECT_EQ(answer.check.num_runs, 11U);
  EXPECT_EQ(answer.check.num_exceedances, 4U);
  EXPECT_EQ(answer.check.num_without_estimate, 2U);
  EXPECT_EQ(answer.missing, (MissingEstimates{.num_no_draw = 1, .num_given_up = 1}));
}

// 0.95⁵⁹ = 0.048. With one run more the sequential verdict takes over, for which 60 are too few.
TEST_F(StoredRequirement, StandsOnceAFixedNumberHasMetIt) {
  Store store = Store::create(file(), test::campaign_of(59), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 59);
  for (Delivery& delivery : deliveries) delivery.result.estimate = delivery.result.truth;
  store.commit(deliveries);
  store.extend(test::campaign_of(60), "");
  std::vector<Delivery> later = test::deliveries_of(59, 60);
  later.front().result.estimate[index(Parameter::a_c12)] += 1.0;
  store.commit(later);
  const std::vector<std::string> texts{"a_c12 < 9e-4 for 95% with 95%",
                                       "a_c12 < 9e-4 for 99% with 95%"};
  const auto rows =
      read_review(store, test::campaign_of(60), ReviewDepth::matrix, numbered_requirements(texts))
          .matrix;
  EXPECT_EQ(rows[0].check.verdict, RequirementVerdict::met);
  EXPECT_EQ(rows[0].check.num_runs, 59U);
  EXPECT_EQ(rule_text(rows[0]), "59 draws, a number fixed before the first result; 1 more since");
  EXPECT_FALSE(rows[0].bound);
  // The later one exceeds, and is the worst of all; the answer is of the others.
  EXPECT_EQ(rows[0].worst->value, 0.0);
  EXPECT_EQ(rows[0].of_all->num_exceedances, 1U);
  EXPECT_FALSE(rows[0].is_opposed());
  EXPECT_EQ(rows[1].check.verdict, RequirementVerdict::undecided);
  EXPECT_EQ(rows[1].check.num_runs, 60U);
}

// Clopper and Pearson's interval of 10 in 75 by scipy.stats.beta: 6.58 to 23.16 %.
TEST_F(StoredRequirement, SaysWhatRunsAfterTheAnswerSpeakAgainst) {
  Store store = Store::create(file(), test::campaign_of(59), "");
  std::vector<Delivery> deliveries = test::deliveries_of(0, 75);
  for (Delivery& delivery : deliveries) {
    delivery.result.estimate = delivery.result.truth;
    const std::uint64_t run = delivery.result.run.value;
    if (run >= 60 && run < 70) delivery.result.estimate[index(Parameter::a_c12)] += 1.0;
  }
  store.commit(std::span(deliveries).first(59));
  store.extend(test::campaign_of(75), "");
  store.commit(std::span(deliveries).subspan(59));
  const std::vector<std::string> texts{"a_c12 < 9e-4 for 95% with 95%"};
  const Review review =
      read_review(store, test::campaign_of(75), ReviewDepth::matrix, numbered_requirements(texts));
  EXPECT_EQ(review.matrix[0].check.verdict, RequirementVerdict::met);
  EXPECT_THAT(review_summary(review)[2].text,
              HasSubstr(". All runs together speak against R1, all."));
  EXPECT_EQ(text_of_all(review.matrix[0]),
            "10 of all 75 runs; 6.58 to 23.2 % of all draws, with 95 %: they speak against this "
            "answer, which more runs may change");
}

TEST_F(StoredRequirement, IsSequentialWithAStopRule) {
  Store store = Store::create(file(), test::campaign_of(60), "");
  store.set_stop_plan({.stop_rule = "std(k2c) within 5%", .num_runs_max = 60, .failures_max = {}});
  EXPECT_FALSE(store.num_runs_fixed().has_value());
  store.set_stop_plan({});
  EXPECT_EQ(store.num_runs_fixed(), 60U);
  store.commit(test::deliveries_of(0, 60));
  store.set_stop_plan({.stop_rule = "std(k2c) within 5%", .num_runs_max = 60, .failures_max = {}});
  EXPECT_EQ(store.num_runs_fixed(), 60U);
}

}  // namespace
}  // namespace proofmass::coordinator
