#include <regex>

#include "coordinator/report/report.hpp"
#include "coordinator/report/requirements.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// HTML without the elements that have no end, which XML does not know.
std::string as_xml(std::string html) {
  html = std::regex_replace(html, std::regex("<!DOCTYPE html>|<meta [^>]*>"), "");
  return std::regex_replace(html, std::regex("<style>[^<]*</style>"), "");
}

class ReviewHtml : public test::ReviewTest {};

TEST_F(ReviewHtml, ShowsTextOfStrangersAsText) {
  const Store store = store_with(20);
  Review review = review_of(store, 20,
                            {{.id = test::hostile_text,
                              .text = test::hostile_text,
                              .requirement = "k2c < 10 for 95% with 90%"}});
  review.database = review.name = review.build = test::hostile_text;
  const std::string html = review_html(review);
  EXPECT_EQ(test::malformed_part(as_xml(html)), "");
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("\x1b"))));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(1)&lt;/script&gt;"));
  const std::string markdown = review_markdown(review);
  EXPECT_THAT(markdown, AllOf(HasSubstr("\\<script\\>"), Not(HasSubstr("\x1b"))));
  EXPECT_THAT(markdown, HasSubstr("\\| \\`code\\`"));
}

// Of 100 runs the error of run r is (r + 1) % of each objective: one is on it, which exceeds it.
// The second largest, 99 %, bounds 95 % of all draws with 90 %, as P(Bin(100, 0.05) ≤ 1) = 0.037;
// the third does not, as P(Bin(100, 0.05) ≤ 2) = 0.118. So one may exceed, and the margin is 1 %.
TEST_F(ReviewHtml, BeginsWithTheVerificationMatrix) {
  const Store store = store_with(100);
  Review review = review_of(store, 100);
  const RequirementAnswer& row = review.matrix.at(static_cast<std::size_t>(Parameter::a_c12));
  EXPECT_NEAR(*row.relative_margin(), 0.01, 1e-12);
  const std::string html = review_html(review);
  const std::size_t matrix = html.find("id=\"matrix\"");
  ASSERT_NE(matrix, std::string::npos);
  EXPECT_LT(matrix, html.find("id=\"accuracy\""));
  EXPECT_THAT(html, HasSubstr("<th scope=\"row\" class=\"words\">a_c12</th>"));
  EXPECT_THAT(html, HasSubstr("<strong class=\"met\">met</strong>"));
  EXPECT_THAT(html, HasSubstr(">|error| of a_c11·Δx, for 95 % with 90 %</td>"));
  EXPECT_THAT(html, HasSubstr(">9×10⁻⁴ rad</td>"));
  EXPECT_THAT(html, HasSubstr("statistical interpretation: mixed"));
  review.interpretation = Interpretation::temporal;
  EXPECT_THAT(review_html(review), HasSubstr("statistical interpretation: temporal"));
  EXPECT_THAT(review_html(review), Not(HasSubstr("mixed")));
}

TEST_F(ReviewHtml, HoldsACampaignWithoutResults) {
  const MicroscopeCampaign campaign = test::campaign_of(5);
  const Store store = Store::create(file(), campaign, canonical_definition(campaign));
  const std::string html = review_html(review_of(store, 5));
  EXPECT_EQ(test::malformed_part(as_xml(html)), "");
  EXPECT_THAT(html, HasSubstr("nothing to show"));
}

// All draws meet a requirement that nobody exceeds, and with 100 draws, of which one may exceed,
// (1 − p)^100 + 100 p (1 − p)^99 campaigns do if p of all draws exceed.
TEST_F(ReviewHtml, DrawsTheOperatingCharacteristic) {
  const Store store = store_with(100);
  const std::vector<Chart> charts = characteristic_charts(review_of(store, 100));
  ASSERT_EQ(charts.size(), 1U);
  const auto& line = std::get<Curve>(charts[0].layers.at(0));
  EXPECT_EQ(line.points.front().y, 100.0);
  for (const Point& point : line.points) {
    const double p = point.x / 100.0;
    const double expected = std::pow(1.0 - p, 100) + 100.0 * p * std::pow(1.0 - p, 99);
    EXPECT_NEAR(point.y, 100.0 * expected, 1e-6) << p;
  }
}

// None of 20 draws can show 95 % with 95 % confidence: there is no curve to draw, and 0.95^59 <
// 0.05 says how many would do.
TEST_F(ReviewHtml, SaysHowManyDrawsDoWhereTheyAreTooFew) {
  const Store store = store_with(20);
  const Review review = review_of(store, 20);
  EXPECT_THAT(characteristic_charts(review), IsEmpty());
  EXPECT_THAT(review_html(review), HasSubstr(">0 of 59</td>"));
}

// Three digits, and of whole numbers all, would show some of them on the other side or on it.
TEST_F(ReviewHtml, ShowsOnWhichSideOfItsLimitAWorstValueLies) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  RequirementAnswer& row = review.matrix.front();
  struct Case {
    double limit_nm, worst_nm;
    std::string limit, worst;
  };
  for (const Case& of :
       {Case{100.0, 81.234, "100", "81.2"}, Case{116.02, 116.0, "116.02", "116"},
        Case{116.02, 116.0301, "116.02", "116.03"}, Case{1235.0, 1235.4, "1235", "1235.4"},
        Case{1234.0, 1233.6, "1234", "1233.6"}, Case{12350.0, 12349.0, "12350", "12349"}}) {
    row.requirement.limit = 1e-9 * of.limit_nm;
    row.worst->value = 1e-9 * of.worst_nm;
    EXPECT_THAT(review_html(review),
                AllOf(HasSubstr(">≤ " + of.limit + " nm<"), HasSubstr(">" + of.worst + " nm<")));
  }
}

/// Spectra of a session with a line of amplitude 3e-9 m/s².
RunSpectra some_spectra() {
  SessionSpectrum spectrum{.session = "a_c13",
                           .meaning = "difference <x>",
                           .unit = "m/s²",
                           .points = {},
                           .lines = {{2e-3, 3e-9, 4e-7, true}, {5e-3, 1e-10, 1e-8, false}},
                           .noise_ratio = NoiseRatio{1.04, 0.03},
                           .noise_meaning = "It is white & quiet."};
  for (double frequency_hz = 1e-4; frequency_hz < 1.0; frequency_hz *= 1.1) {
    spectrum.points.push_back({frequency_hz, 2e-9, 2e-9, 2e-9});
  }
  return {.run = RunIndex{7}, .sessions = {spectrum}, .reasons = {test::hostile_text}};
}

TEST_F(ReviewHtml, ShowsTheSpectraOfTheWorstRun) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  EXPECT_THAT(review_html(review), Not(HasSubstr("Spectra of the worst run")));
  review.spectra = some_spectra();
  const std::string html = review_html(review);
  EXPECT_EQ(test::malformed_part(as_xml(html)), "");
  EXPECT_THAT(html, AllOf(HasSubstr("<h2 id=\"spectra-section-title\">Spectra of the worst run"),
                          HasSubstr("a_c13: difference &lt;x&gt;"), HasSubstr("m/s²/√Hz"),
                          HasSubstr("an amplitude of 3×10⁻⁹ m/s²."),
                          HasSubstr("<td data-value=\"3e-09\">3×10⁻⁹</td>"),
                          HasSubstr(">1.04 ± 0.03</td>"), HasSubstr("It is white &amp; quiet."),
                          HasSubstr("noise model"), Not(HasSubstr("<script>"))));
  review.spectra->sessions[0].noise_ratio.reset();
  EXPECT_THAT(review_html(review),
              AllOf(HasSubstr("noise model"), Not(HasSubstr(" times that of its model"))));
  for (SpectrumPoint& point : review.spectra->sessions[0].points) point.expected = 0.0;
  EXPECT_THAT(review_html(review), Not(HasSubstr("noise model")));
  review.spectra->sessions.clear();
  const std::string reasons = review_html(review);
  EXPECT_THAT(reasons, AllOf(HasSubstr("&lt;script&gt;"), Not(HasSubstr("bit for bit"))));
}

// Run 19 is off by a fifth of the objective, and by ten of one that is 50 times as small.
TEST_F(ReviewHtml, ShowsErrorsHoweverFarBeyondTheirObjectives) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  for (const Chart& chart : magnitude_overview(review).charts) EXPECT_EQ(chart.x.to, 3.0);
  review.objectives[2] /= 50.0;
  const ChartGrid grid = magnitude_overview(review);
  for (const Chart& chart : grid.charts) {
    EXPECT_GE(chart.x.to, 10.0);
    EXPECT_LE(chart.x.to, 10.0 * 1.3) << "a bin ends a tenth of a decade on at most";
  }
}

TEST_F(ReviewHtml, NamesIntervalsThatAreDrawn) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  const auto names_of = [&] {
    std::string names;
    for (const auto& [name, picture] : review_pictures(review)) {
      if (!name.ends_with(":" + review.schema.quantities[0].name)) continue;
      for (const Layer& layer : std::get<Chart>(picture).layers) {
        if (const auto* const line = std::get_if<LimitLine>(&layer)) names += line->label + ";";
        if (const auto* const band = std::get_if<Band>(&layer)) names += band->name + ";";
      }
    }
    return names;
  };
  EXPECT_THAT(names_of(), AllOf(HasSubstr("with 95 % interval"), HasSubstr("mean, 95 %;"),
                                HasSubstr("std, 95 %;")));
  review.results.statistics.accuracy[0].error.bias_interval.reset();
  for (ConvergencePoint& point : review.figures[0].convergence) {
    point.mean_interval.reset();
    point.deviation_interval.reset();
  }
  EXPECT_THAT(names_of(), AllOf(HasSubstr("bias "), Not(HasSubstr("95 %"))));
}

TEST_F(ReviewHtml, KnowsTheWorstRun) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  ASSERT_TRUE(worst_run_of(review).has_value());
  EXPECT_EQ(*worst_run_of(review), RunIndex{19});
  review.matrix.pop_back();  // All objectives together.
  EXPECT_FALSE(worst_run_of(review).has_value());
}

class ReviewSummary : public test::ReviewTest {
 protected:
  static std::vector<std::string> sentences_of(const Review& review) {
    std::vector<std::string> texts;
    for (const SummarySentence& sentence : review_summary(review)) texts.push_back(sentence.text);
    EXPECT_EQ(texts.size(), 5U);
    return texts;
  }
};

// Of 100 runs the error of run r is (r + 1) % of each objective.
TEST_F(ReviewSummary, TellsWhatWasAskedAndWhatCameOut) {
  const Store store = store_with(100);
  const std::vector<std::string> sentences = sentences_of(review_of(store, 100));
  EXPECT_EQ(sentences[0],
            "It was asked whether 95 % of all draws meet the objective of each parameter, and all "
            "objectives together, each with 90 % confidence, which is the default of the program "
            "and no demand of a project.");
  EXPECT_EQ(sentences[1], "All 100 draws are done.");
  EXPECT_EQ(sentences[2], "Of 11 requirements, 11 are met.");
  EXPECT_EQ(sentences[3],
            "The worst error is that of a_c11·Δx in run 99, 100 nm or 100 % of its objective; what "
            "drives it is not known, as fewer than 16 draws have an estimate.");
  EXPECT_THAT(sentences[4], testing::MatchesRegex(
                                "Calibration takes the budget of the test of the equivalence "
                                "principle from .* m/s² to at most .* m/s² in "
                                "half of the draws, .* m/s² in 95 % of them, and .* m/s² in the "
                                "worst, run 99\\."));
}

// 10 of 100 draws exceed 90 % of the objective: not met for 95 %, and undecided for 90 % of them.
TEST_F(ReviewSummary, NamesRequirementsThatAreNotMet) {
  const Store store = store_with(100);
  const std::vector<std::string> sentences = sentences_of(
      review_of(store, 100,
                {{.id = "A",
                  .text = "Objective of the mission",  // As the program says of its own ones.
                  .requirement = "k2c < 901 for 99% with 90%"},
                 {.id = "B", .text = "", .requirement = "k2c < 901 for 90% with 90%"}}));
  EXPECT_EQ(sentences[0],
            "It was asked whether 2 requirements hold: A, B, and all objectives together.");
  EXPECT_EQ(sentences[2], "Of 3 requirements, 1 is met, 1 is not met (A), 1 is undecided (B).");
}

TEST_F(ReviewSummary, SaysWhatIsMissing) {
  Store store = store_with(20);
  store.extend(test::campaign_of(30), canonical_definition(test::campaign_of(30)));
  Review review = review_of(store, 30);
  EXPECT_EQ(sentences_of(review)[1], "The campaign is not finished: 20 of 30 draws are done.");
  review.is_cancelled = true;
  EXPECT_EQ(sentences_of(review)[1], "The campaign was cancelled: 20 of 30 draws are done.");
  review.is_cancelled = false;
  review.results.missing.num_given_up = 1;
  EXPECT_EQ(sentences_of(review)[1],
            "The campaign is not finished: 21 of 30 draws are done, 1 of them without an estimate "
            "(1 given up), which counts as an exceedance.");
}

TEST_F(ReviewSummary, KnowsACampaignWithoutResults) {
  const MicroscopeCampaign campaign = test::campaign_of(5);
  const Store store = Store::create(file(), campaign, canonical_definition(campaign));
  const std::vector<std::string> sentences = sentences_of(review_of(store, 5));
  EXPECT_EQ(sentences[1], "The campaign is not finished: 0 of 5 draws are done.");
  EXPECT_THAT(sentences[2], HasSubstr("11 are undecided (a_c11·Δx, "));
  EXPECT_EQ(sentences[3], "No draw has an estimate, so that there is no worst error.");
  EXPECT_THAT(sentences[4], HasSubstr("what is left after it cannot be told without an estimate"));
}

TEST_F(ReviewSummary, NamesWhatDrivesTheWorstError) {
  const Store store = store_with(100);
  Review review = review_of(store, 100);
  review.causes = Causes{};
  AccuracyStatistic& of_delta_x = review.results.statistics.accuracy[0];
  const ErrorStatistic error = of_delta_x.error;
  of_delta_x.error.bias = -9e-8;
  of_delta_x.error.standard_deviation = 4e-9;
  EXPECT_THAT(
      sentences_of(review)[3],
      HasSubstr("; most of it is a bias that all runs share, −90 nm with a standard deviation "
                "of 4 nm, which follows from the campaign and not from its draws."));
  review.results.statistics.num_estimated = 2;  // Then 4 nm are too few to tell, as with one run.
  of_delta_x.error.standard_deviation = 4e-8;
  EXPECT_THAT(sentences_of(review)[3], Not(HasSubstr("bias")));
  review.results.statistics.num_estimated = 1;
  of_delta_x.error.standard_deviation = 0.0;
  EXPECT_THAT(sentences_of(review)[3], Not(HasSubstr("bias")));
  review.results.statistics.num_estimated = 100;
  of_delta_x.error = error;
  EXPECT_THAT(
      sentences_of(review)[3],
      HasSubstr(
          "; in 0 draws no drawn quantity or product of two was found to explain it; whether "));
  const auto term = [](std::string name, double share) {
    return CauseTerm{.name = std::move(name), .found = {.second = {}, .share = share}};
  };
  review.causes->terms = {term("true a × b", 0.982), term("c", 0.01)};
  EXPECT_THAT(sentences_of(review)[3],
              HasSubstr("100 nm or 100 % of its objective; of the variance of this error over the "
                        "draws, 98.2 % goes with true a × b."));
}

TEST_F(ReviewSummary, HoldsWithoutObjectivesAndBudget) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  review.matrix.clear();
  review.budget.reset();
  for (double& objective : review.objectives) objective = std::numeric_limits<double>::infinity();
  const std::vector<std::string> sentences = sentences_of(review);
  EXPECT_THAT(sentences[0], HasSubstr("nothing was asked"));
  EXPECT_EQ(sentences[2], "There is no verdict.");
  EXPECT_EQ(sentences[3], "No parameter has an objective to hold its worst error against.");
  EXPECT_EQ(sentences[4], "The model has no budget that the errors would enter.");
}

/// Each sentence leads to a section that is there, whatever the review lacks.
TEST_F(ReviewSummary, NamesItsSources) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  const auto expect_links = [&] {
    const std::string html = review_html(review);
    for (const SummarySentence& sentence : review_summary(review)) {
      EXPECT_THAT(html, HasSubstr("-title\">" + sentence.section + "</h2>")) << sentence.text;
    }
  };
  expect_links();
  review.causes = Causes{};
  review.budget.reset();
  expect_links();
}

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
  VerificationMatrix matrix(test::schema(), stated, ones(), {.num_given_up = num_given_up},
                            num_fixed);
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
  const std::vector<StatedRequirement> requirements =
      matrix_requirements(test::schema(), {}, objectives);
  ASSERT_EQ(requirements.size(), num_parameters);  // One less, and all together.
  EXPECT_EQ(requirements[0].requirement, "a_c11_delta_x <= 0.3333333333333333 for 95% with 90%");
  EXPECT_EQ(test::parse_requirement(requirements[0].requirement).limit, objectives[0]);
  EXPECT_EQ(requirements.back().requirement, "all objectives for 95% with 90%");
}

TEST(MatrixRequirements, KeepTheirOrderAndEndWithAllObjectivesIfThatIsNotAmongThem) {
  const std::vector<double> objectives = ones();
  const auto two = matrix_requirements(
      test::schema(),
      {stated("all objectives for 99% with 95%"), stated("k2c < 1 for 9% with 90%")}, objectives);
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[0].requirement, "all objectives for 99% with 95%");
  const auto added =
      matrix_requirements(test::schema(), {stated("k2c < 1 for 9% with 90%")}, objectives);
  ASSERT_EQ(added.size(), 2U);
  EXPECT_EQ(added[1].requirement, "all objectives for 95% with 90%");
  const std::vector<double> none(num_parameters, std::numeric_limits<double>::infinity());
  EXPECT_TRUE(matrix_requirements(test::schema(), {}, none).empty());
}

// Of 100 runs 2 may exceed 0.95 with 0.9 if their number was fixed, else 0; the bound goes with it.
TEST(VerificationMatrix, BoundsByTheRuleOfItsVerdict) {
  const std::vector<StatedRequirement> one{stated("a_c12 < 0.6 for 95% with 90%")};
  const std::vector<RunResult> results = some_results(100);
  const RequirementAnswer fixed = answers_to(one, results, 0, 100)[0];
  const RequirementAnswer open = answers_to(one, results)[0];
  EXPECT_TRUE(fixed.check.is_of_fixed_size);
  EXPECT_FALSE(open.check.is_of_fixed_size);
  EXPECT_GT(fixed.check.bound_order, open.check.bound_order);
  EXPECT_LT(*fixed.bound, *open.bound);
}

TEST(JudgedRuns, EndBeforeTheFirstThatIsMissing) {
  const auto judged = [](const std::vector<RunRange>& finished,
                         const std::vector<RunRange>& given_up) {
    const JudgedRuns runs = judged_runs(finished, given_up);
    return std::array{runs.end, runs.num_given_up, runs.num_left_out};
  };
  EXPECT_THAT(judged({}, {}), ElementsAre(0, 0, 0));
  EXPECT_THAT(judged({{{0}, 10}}, {}), ElementsAre(10, 0, 0));
  EXPECT_THAT(judged({{{0}, 4}, {{6}, 4}}, {{{4}, 2}}), ElementsAre(10, 2, 0));
  EXPECT_THAT(judged({{{0}, 4}, {{6}, 4}}, {{{4}, 1}, {{12}, 3}}), ElementsAre(5, 1, 7));
  EXPECT_THAT(judged({{{100}, 50}}, {}), ElementsAre(150, 0, 0)) << "a part of a campaign";
}

// Every tenth run exceeds, and takes so long that only the first two of them are there.
TEST(VerificationMatrix, LeavesOutRunsAfterTheFirstThatIsMissing) {
  std::vector<RunResult> results;
  std::vector<RunRange> finished;
  for (std::uint64_t run = 0; run < 200; ++run) {
    const bool exceeds = run % 10 == 9;
    if (exceeds && run > 19) continue;
    results.push_back(result_with(run, exceeds ? 0.9 : 0.001 * static_cast<double>(run)));
    append(finished, {run});
  }
  const auto row_of = [&](const std::string& requirement) {
    VerificationMatrix matrix(test::schema(), {stated(requirement)}, ones(),
                              judged_runs(finished, {}), {});
    for (const RunResult& result : results) matrix.add(result);
    matrix.add_magnitudes(0, std::vector<double>(results.size(), 7.0));
    return matrix.answers()[0];
  };
  const RequirementAnswer row = row_of("a_c11_delta_x < 0.5 for 92% with 90%");
  EXPECT_EQ(row.check.num_runs, 29U);
  EXPECT_EQ(row.check.num_exceedances, 2U);
  EXPECT_EQ(row.check.verdict, RequirementVerdict::undecided);
  EXPECT_EQ(rule_text(row),
            "sequential: holds however often one looks and goes on; left out: 153 runs after the "
            "first that is missing");
  EXPECT_LE(row_of("a_c11_delta_x < 1 for 30% with 50%").bound.value(), 0.9);
}

// Runs without a session that watches the loops do not tell the level of a budget.
TEST(VerificationMatrix, NamesTheLevelThatItAssumes) {
  const std::vector<StatedRequirement> both{stated("budget < 1 for 95% with 90%"),
                                            stated("k2c < 1 for 95% with 90%")};
  RunResult told = result_with(0, 0.1), untold = result_with(1, 0.1);
  told.health = test::values_of({.residual_m_s2 = 1e-10});
  untold.health = test::values_of({});
  const auto assumptions = [&](const RunResult& second) {
    VerificationMatrix matrix(test::schema(), both, ones(), {}, {},
                              MicroscopeCampaign().error_budget());
    matrix.add(told);
    matrix.add(second);
    std::vector<std::string> all;
    for (const RequirementAnswer& row : matrix.answers()) all.push_back(row.assumption);
    return all;
  };
  EXPECT_THAT(assumptions(told), ElementsAre("", ""));
  EXPECT_THAT(assumptions(untold), ElementsAre("Γ_res = 1e-12 m/s²", ""));
}

}  // namespace
}  // namespace proofmass::coordinator
