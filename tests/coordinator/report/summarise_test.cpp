#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/report/review.hpp"
#include "core/model.hpp"
#include "core/statistics/moments.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

class Summarise : public test::StoreTest {
 protected:
  /// A finished campaign with this plan, whose errors have these magnitudes in turn and alternate
  /// in sign; run 3 is without an estimate.
  Store finished(std::uint64_t num_runs, const StopPlan& plan, double even, double odd) {
    Store store = Store::create(file(), test::campaign_of(num_runs), "");
    store.set_stop_plan(plan);
    std::vector<Delivery> deliveries = test::deliveries_of(0, num_runs);
    for (Delivery& delivery : deliveries) {
      delivery.result.truth.assign(num_parameters, 0.0);
      delivery.result.estimate.assign(num_parameters,
                                      delivery.result.run.value % 2 == 0 ? even : -odd);
    }
    deliveries[3].result.status = RunStatus::no_draw;
    store.commit(deliveries);
    return store;
  }

  std::optional<std::uint64_t> next_runs(Store& store) {
    return summarise_file(file(), MicroscopeCampaign{},
                          [&](const std::function<void(Store&)>& action) { action(store); });
  }

  static StopPlan plan_of(const std::string& rule) {
    return {.stop_rule = rule, .num_runs_max = 1000, .failures_max = {}};
  }
};

// All magnitudes are 1 but for run 3, which has no estimate: one of 128 exceeds. The bound is the
// sequential one, 5.0833 % (scipy.optimize.brentq of the evidence).
TEST_F(Summarise, DecidesARequirement) {
  Store store = finished(128, plan_of("k2c < 2 for 90% with 95% decided"), 1, 1);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_FALSE(is_rule_missed(store));
  EXPECT_EQ(stop_outcome(store)->text,
            "Stopping  k2c < 2 for 90% with 95% decided\n"
            "          met after 128 runs; exceeding: 1\n"
            "          at most 5.083 % of all draws, with 95 %\n");
  EXPECT_TRUE(stop_check_differences(store, MicroscopeCampaign{}.objectives()).empty());
}

// The same of all objectives, which hold in all runs but run 3: 1 − 5.0833 %.
TEST_F(Summarise, DecidesARequirementOnAllObjectives) {
  Store store = finished(128, plan_of("all objectives for 90% with 95% decided"), 0, 0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_FALSE(is_rule_missed(store));
  EXPECT_EQ(stop_outcome(store)->text,
            "Stopping  all objectives for 90% with 95% decided\n"
            "          met after 128 runs; holding: 127\n"
            "          at least 94.92 % of all draws, with 95 %\n");
}

// A requirement that is decided and not met is missed; the campaign ends all the same.
TEST_F(Summarise, EndsWhenARequirementCannotBeMet) {
  Store store = finished(128, plan_of("k2c < 2 for 90% with 95% decided"), 1, 3);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_TRUE(is_rule_missed(store));
}

TEST_F(Summarise, GoesOnWhileARequirementIsUndecided) {
  Store store = finished(128, plan_of("k2c < 2 for 99% with 95% decided"), 1, 1);
  EXPECT_EQ(next_runs(store), 192U);
  EXPECT_TRUE(is_rule_missed(store));
}

// Errors of 1 exceed every objective but those of the quadratic factors.
TEST_F(Summarise, CountsWhereAllObjectivesHold) {
  Store store = finished(128, plan_of("all objectives within 50%"), 0, 1);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_EQ(store.stop_checks().back().check.estimate, 0.5);
  EXPECT_EQ(stop_outcome(store)->text,
            "Stopping  all objectives within 17.9 %, half its 95 % interval\n"
            "          in 64 of 128 runs, 41 to 59 % of all draws\n"
            "          after 128 runs; all objectives within 50%: reached\n");
  EXPECT_TRUE(stop_check_differences(store, MicroscopeCampaign{}.objectives()).empty());
}

// Or a program that stops before the check would say that the rule holds.
TEST_F(Summarise, MissesARuleThatWasNotCheckedWithAllRuns) {
  Store store = finished(128, plan_of("mean(k2c) within 5%"), 1.0, 1.01);
  EXPECT_TRUE(lacks_stop_check(store));
  EXPECT_TRUE(is_rule_missed(store));
  (void)next_runs(store);
  EXPECT_FALSE(lacks_stop_check(store));
  EXPECT_FALSE(is_rule_missed(store));
  store.extend(test::campaign_of(192), "");
  EXPECT_TRUE(lacks_stop_check(store));
  EXPECT_TRUE(is_rule_missed(store));
}

// As of a campaign that was cancelled, whose other runs may still be computed.
TEST_F(Summarise, ChecksNoRuleBeforeAllRunsAreThere) {
  Store store = finished(128, plan_of("mean(k2c) within 5%"), 1.0, 1.01);
  store.extend(test::campaign_of(192), "");
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_EQ(text("SELECT num_finished FROM summary"), "128");
  EXPECT_TRUE(store.stop_checks().empty());
}

TEST_F(Summarise, WithoutARuleStoresStatisticsAlone) {
  Store store = finished(10, {}, 1.0, 3.0);
  EXPECT_EQ(next_runs(store), std::nullopt);
  EXPECT_EQ(text("SELECT num_estimated FROM summary"), "9");
  EXPECT_FALSE(lacks_stop_check(store));
  EXPECT_FALSE(is_rule_missed(store));
}

// Digests of the documented bytes, made with Python's struct and hashlib.
constexpr const char* digest_of_nothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr const char* digest_of_first =
    "1c67be44c7551128152e0805d20a1b8dfd788b49043e0db4763ad2a348fb1a01";
constexpr const char* digest_of_both =
    "d5f80df1d4e2a241fce93f8e659cbee48dd74c1d43ddd97d80854098cfedd596";
constexpr const char* health_of_first =
    "00e4d422c3e49483ec1334fd153b0c663b97d722ed65b8628b80958fdf708ae1";
constexpr const char* health_with_lost =
    "662fe94c7831e505adef1b9b28de61e22a86d931d155a97445bdb6716a4ea92c";

RunResult first_result() {
  RunResult result = test::zero_result(
      {.run = {7}, .status = RunStatus::not_converged, .num_draws = 3, .num_rounds = 5});
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = 0.5 + static_cast<double>(i);
    result.estimate[i] = -1.25 * static_cast<double>(i);  // The first one is a negative zero.
  }
  return result;
}

/// A result without a draw, with numbers that mean nothing.
RunResult second_result() {
  RunResult result = test::zero_result(
      {.run = {8}, .status = RunStatus::no_draw, .num_draws = 1000, .num_rounds = 0});
  result.truth.assign(num_parameters, 1.0);
  result.estimate.assign(num_parameters, 2.0);
  return result;
}

TEST(Digest, OfNothingIsThatOfNoBytes) {
  EXPECT_EQ(Digest(test::schema()).finish(),
            (ResultDigests{.results = digest_of_nothing, .health = ""}));
}

TEST(Digest, IsThatOfTheDocumentedBytes) {
  Digest digest(test::schema());
  digest.add(first_result());
  EXPECT_EQ(digest.finish().results, digest_of_first);
}

TEST(Digest, LeavesOutWhatMeansNothing) {
  Digest digest(test::schema());
  digest.add(first_result());
  digest.add(second_result());
  EXPECT_EQ(digest.finish(), (ResultDigests{.results = digest_of_both, .health = ""}));
}

TEST(Digest, OfHealthIsThatOfTheDocumentedBytesAndStandsAlone) {
  RunResult first = first_result();
  first.health = test::values_of({1e-7, 2e-5, -0.0, 0.25, 3e-4});
  first.loss.session = 9;  // Means nothing: the run is not lost.

  Digest digest(test::schema());
  digest.add(first);
  digest.add(second_result());
  EXPECT_EQ(digest.finish(), (ResultDigests{.results = digest_of_both, .health = health_of_first}));

  RunResult lost = test::zero_result({.run = {9}, .status = RunStatus::lost});
  lost.health = test::values_of({1e-5, 2e-5, 1e-12, 0.25, 3e-4});
  lost.loss = test::loss_of(LossCause::saturation, SessionTarget::a_d11_prime);
  Digest with_lost(test::schema());
  with_lost.add(first);
  with_lost.add(lost);
  EXPECT_EQ(with_lost.finish().health, health_with_lost);
}

/// A run with one quantity, whose error is this.
RunResult run_with(std::uint64_t run, double error) {
  return {.run = {run}, .truth = {2.0}, .estimate = {2.0 + error}};
}

double error_at(std::uint64_t run) { return std::ldexp(std::sin(static_cast<double>(run)), -3); }

// Fewer than two points are no line.
TEST(ConvergenceCounts, AscendFromFiveToAllRuns) {
  EXPECT_TRUE(convergence_counts(0).empty());
  EXPECT_THAT(convergence_counts(3), ElementsAre(1, 2, 3));
  EXPECT_THAT(convergence_counts(5), ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(convergence_counts(7), ElementsAre(5, 6, 7));
  const std::vector<std::uint64_t> counts = convergence_counts(1'000'000);
  EXPECT_EQ(counts.size(), 41U);
  EXPECT_EQ(counts.front(), 5U);
  EXPECT_EQ(counts.back(), 1'000'000U);
  // Equal steps of a logarithmic axis: each number is 200,000^(1/40) = 1.357 times the one before.
  EXPECT_NEAR(static_cast<double>(counts[30]) / static_cast<double>(counts[29]), 1.357, 0.001);
}

TEST(ErrorFigures, HaveTheMomentsOfTheFirstRuns) {
  ErrorFigures collected(1, 300);
  std::vector<double> magnitudes;
  for (std::uint64_t run = 0; run < 300; ++run) {
    collected.add(run_with(run, error_at(run)));
    magnitudes.push_back(std::abs((2.0 + error_at(run)) - 2.0));
  }
  const std::vector<QuantityFigures> figures = collected.figures();
  ASSERT_EQ(figures.size(), 1U);
  ASSERT_EQ(figures[0].convergence.back().num_runs, 300U);
  for (const ConvergencePoint& point : figures[0].convergence) {
    const std::span<const double> first = std::span(magnitudes).first(point.num_runs);
    const Moments expected = moments(first);
    EXPECT_NEAR(point.mean, expected.mean, 1e-13 * expected.mean);
    EXPECT_NEAR(point.standard_deviation, expected.standard_deviation,
                1e-12 * expected.standard_deviation);
    EXPECT_EQ(point.worst, *std::ranges::max_element(first));
    EXPECT_NEAR(point.deviation_interval->upper, deviation_interval(expected, 0.95)->upper,
                1e-9 * point.standard_deviation);
  }
}

TEST(ErrorFigures, NameTheFiveWorstRuns) {
  ErrorFigures collected(1, 8);
  const std::vector<double> errors{0.25, -0.5, 0.125, 0.5, -1.0, 0.0, 0.75, 0.0625};
  for (std::uint64_t run = 0; run < errors.size(); ++run) collected.add(run_with(run, errors[run]));
  const std::vector<QuantityFigures> figures = collected.figures();
  std::vector<std::uint64_t> runs;
  for (const RunValue& worst : figures[0].worst) runs.push_back(worst.run.value);
  EXPECT_THAT(runs, ElementsAre(4, 6, 1, 3, 0));  // Of the equal ones 1 and 3 the first.
}

TEST(ErrorFigures, LeaveOutRunsWithoutAnEstimate) {
  ErrorFigures collected(1, 10);
  for (std::uint64_t run = 0; run < 10; ++run) {
    RunResult result = run_with(run, 0.5);
    if (run >= 7) result = {.run = {run}, .status = RunStatus::not_finite, .truth = {2.0}};
    collected.add(result);
  }
  EXPECT_EQ(collected.figures()[0].convergence.back().num_runs, 7U);
}

std::uint64_t sum_of(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

/// How many values are in [lower, upper), counted one by one.
std::uint64_t count_between(const std::vector<double>& values, double lower, double upper) {
  return static_cast<std::uint64_t>(
      std::ranges::count_if(values, [&](double value) { return value >= lower && value < upper; }));
}

std::vector<double> normal_values(std::size_t count, double sigma) {
  std::mt19937_64 bits(7);
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    double sum = -6.0;  // Of twelve uniform ones: nearly normal, the same on every machine.
    for (int term = 0; term < 12; ++term) sum += static_cast<double>(bits() >> 11) * 0x1p-53;
    values.push_back(sigma * sum);
  }
  return values;
}

TEST(ErrorBins, CountEachValueBetweenItsEdges) {
  const std::vector<double> values = normal_values(5000, 3e-4);
  ErrorBins bins;
  for (const double value : values) bins.add(value);
  const Histogram histogram = bins.histogram();
  ASSERT_EQ(histogram.edges.size(), histogram.counts.size() + 1);
  EXPECT_LE(histogram.counts.size(), 64U);
  EXPECT_GE(histogram.counts.size(), 20U);
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    EXPECT_EQ(histogram.counts[i],
              count_between(values, histogram.edges[i], histogram.edges[i + 1]));
  }
  EXPECT_EQ(sum_of(histogram.counts), values.size());
}

TEST(ErrorBins, DoNotDependOnTheOrder) {
  std::vector<double> values = normal_values(1000, 1.0);
  ErrorBins forwards, backwards;
  for (const double value : values) forwards.add(value);
  std::ranges::reverse(values);
  for (const double value : values) backwards.add(value);
  EXPECT_EQ(forwards.histogram().edges, backwards.histogram().edges);
  EXPECT_EQ(forwards.histogram().counts, backwards.histogram().counts);
}

TEST(ErrorBins, HoldZerosAndTheLargestValues) {
  ErrorBins bins;
  EXPECT_TRUE(bins.histogram().counts.empty());
  bins.add(0.0);
  bins.add(-1e90);
  bins.add(1e90);
  EXPECT_EQ(sum_of(bins.histogram().counts), 3U);
}

// Sums of twelve lie within 6σ of their mean. Bins of half the width would be more than 64, so that
// 12σ would be wider than 63 of these, wherever the mean is.
TEST(ErrorBins, ShowTheScatterBesideABias) {
  ErrorBins bins;
  for (const double value : normal_values(5000, 1e-5)) bins.add(1e-3 + value);
  const Histogram histogram = bins.histogram();
  EXPECT_LE(histogram.edges[1] - histogram.edges[0], 2 * 12e-5 / 63);
  EXPECT_GT(histogram.edges.front(), 0.9e-3);
  EXPECT_LT(histogram.edges.back(), 1.1e-3);
}

TEST(ErrorBins, AreNarrowAroundAConstant) {
  ErrorBins bins;
  for (int i = 0; i < 7; ++i) bins.add(0.25);
  const Histogram histogram = bins.histogram();
  EXPECT_THAT(histogram.counts, ElementsAre(7));
  EXPECT_NEAR(histogram.edges[0], 0.25, 1e-7);
  EXPECT_NEAR(histogram.edges[1], 0.25, 1e-7);
}

// Ten bins a power of ten: 1, 2 and 5 are in the bins from 10^0, 10^0.3 and 10^0.6 on.
TEST(MagnitudeBins, AreTenAPowerOfTen) {
  MagnitudeBins bins;
  for (const double value : {1.0001, 2.1, 5.1, 5.2}) bins.add(value);
  const Histogram histogram = bins.histogram();
  EXPECT_THAT(histogram.counts, ElementsAre(1, 0, 0, 1, 0, 0, 0, 2));
  EXPECT_NEAR(histogram.edges.front(), 1.0, 1e-12);
  EXPECT_NEAR(histogram.edges.back(), std::pow(10.0, 0.8), 1e-9);
}

TEST(MagnitudeBins, CountZerosBesideTheBins) {
  MagnitudeBins bins;
  bins.add(0.0);
  bins.add(1e-200);
  EXPECT_TRUE(bins.histogram().edges.empty());
  for (int i = 0; i < 9; ++i) bins.add(1.5);
  EXPECT_EQ(bins.histogram().num_below, 2U);
  EXPECT_THAT(bins.histogram().counts, ElementsAre(9));
}

using DrawnErrors = test::ReviewTest;

std::vector<double> heights_of(const Chart& chart) {
  return std::get<Bars>(chart.layers.front()).heights;
}

/// What `plot` draws of these magnitudes of the first quantity, in units of its objective.
struct DrawnMagnitudes {
  DrawnMagnitudes(Review review, Histogram histogram) {
    for (double& edge : histogram.edges) edge *= review.objectives[0];
    review.figures[0].magnitudes = std::move(histogram);
    for (const Part& part : error_parts(review)) {
      const auto* const picture = std::get_if<NamedPicture>(&part);
      if (picture == nullptr || !picture->name.starts_with("histogram:")) continue;
      single = std::get<Chart>(picture->picture);
      break;
    }
    in_overview = magnitude_overview(review).charts.front();
  }

  Chart single;
  Chart in_overview;
};

// One of 200 values is less than 1 %: alone it would double the axis of a picture of its own. The
// common axis of all quantities begins at 1e-4 of the objective anyway.
TEST_F(DrawnErrors, LeaveOutOnePercentWhereTheirAxisWouldBeForIt) {
  const DrawnMagnitudes drawn(review_of(store_with(1), 1),
                              {.edges = {0.001, 0.01, 0.1}, .counts = {1, 199}, .num_below = 5});
  EXPECT_THAT(heights_of(drawn.single), ElementsAre(199));
  EXPECT_THAT(drawn.single.x.label, EndsWith("; 6 smaller not shown"));
  EXPECT_THAT(heights_of(drawn.in_overview), ElementsAre(1, 199));
  EXPECT_EQ(drawn.in_overview.x.label, "|error| / objective; 5 smaller");
}

TEST_F(DrawnErrors, ShowTenPercent) {
  const DrawnMagnitudes drawn(review_of(store_with(1), 1),
                              {.edges = {0.001, 0.01, 0.1}, .counts = {10, 90}, .num_below = 0});
  EXPECT_THAT(heights_of(drawn.single), ElementsAre(10, 90));
  EXPECT_THAT(drawn.single.x.label, Not(HasSubstr("not shown")));
}

}  // namespace
}  // namespace proofmass::coordinator
