#include "coordinator/report/review_html.hpp"

#include <gmock/gmock.h>

#include <regex>
#include <set>
#include <string>

#include "coordinator/report/review_charts.hpp"
#include "coordinator/report/review_markdown.hpp"
#include "coordinator/report/review_tables.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// HTML without the elements that have no end, which XML does not know.
std::string as_xml(std::string html) {
  html = std::regex_replace(html, std::regex("<!DOCTYPE html>|<meta [^>]*>"), "");
  return std::regex_replace(html, std::regex("<style>[^<]*</style>"), "");
}

class ReviewHtml : public test::ReviewTest {};

TEST_F(ReviewHtml, IsWellFormed) {
  const Store store = store_with(60);
  EXPECT_EQ(test::malformed_part(as_xml(review_html(review_of(store, 60)))), "");
}

TEST_F(ReviewHtml, HasEachIdOnce) {
  const Store store = store_with(60);
  std::set<std::string> ids;
  for (const std::string& tag :
       test::tags_of(review_html(review_of(store, 60)), " id=\"[^\"]*\"")) {
    EXPECT_TRUE(ids.insert(tag).second) << tag;
  }
  EXPECT_GT(ids.size(), 50U);
}

TEST_F(ReviewHtml, NeitherLoadsNorRunsAnything) {
  const Store store = store_with(60);
  const std::string html = review_html(review_of(store, 60));
  EXPECT_THAT(html, HasSubstr("content=\"default-src 'none'; style-src 'unsafe-inline';"));
  EXPECT_THAT(html,
              AllOf(Not(HasSubstr("<script")), Not(HasSubstr(" src=")), Not(HasSubstr("http://")),
                    Not(HasSubstr("https://")), Not(HasSubstr("@import"))));
}

TEST_F(ReviewHtml, ShowsTextOfStrangersAsText) {
  const Store store = store_with(20);
  Review review = review_of(store, 20,
                            {{.id = test::hostile_text,
                              .text = test::hostile_text,
                              .requirement = "k2c < 10 for 95% with 90%"}});
  review.database = review.identity.name = review.identity.build = test::hostile_text;
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
  const MatrixRow& row = review.matrix.at(static_cast<std::size_t>(Parameter::a_c12));
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

TEST_F(ReviewHtml, SaysThatACampaignIsNotFinished) {
  Store store = store_with(20);
  EXPECT_THAT(review_html(review_of(store, 20)), Not(HasSubstr("is not finished")));
  store.extend(test::campaign_of(30), canonical_definition(test::campaign_of(30)));
  EXPECT_THAT(review_html(review_of(store, 30)), HasSubstr("20 of 30 draws are done"));
  EXPECT_THAT(review_html(review_of(store, 30)), HasSubstr("The campaign is not finished"));
}

TEST_F(ReviewHtml, HoldsACampaignWithoutResults) {
  const MicroscopeCampaign campaign = test::campaign_of(5);
  const Store store = Store::create(file(), campaign, canonical_definition(campaign));
  const std::string html = review_html(review_of(store, 5));
  EXPECT_EQ(test::malformed_part(as_xml(html)), "");
  EXPECT_THAT(html, HasSubstr("no data"));
}

TEST_F(ReviewHtml, IsTheSameEachTime) {
  const Store store = store_with(40);
  EXPECT_EQ(review_html(review_of(store, 40)), review_html(review_of(store, 40)));
}

TEST_F(ReviewHtml, NamesItsCharts) {
  const Store store = store_with(40);
  std::vector<std::string> names;
  for (const NamedPicture& named : review_pictures(review_of(store, 40))) {
    names.push_back(named.name);
  }
  EXPECT_THAT(names, testing::IsSupersetOf({"errors", "convergence", "histogram:a_c12", "error:k2c",
                                            "convergence:k2d", "characteristic", "budget"}));
}

// All draws meet a requirement that nobody exceeds, and with 100 draws, of which one may exceed,
// (1 − p)^100 + 100 p (1 − p)^99 campaigns do if p of all draws exceed.
TEST_F(ReviewHtml, DrawsTheOperatingCharacteristic) {
  const Store store = store_with(100);
  const std::vector<Chart> charts = characteristic_charts(review_of(store, 100));
  ASSERT_EQ(charts.size(), 1U);
  const auto& line = std::get<Line>(charts[0].layers.at(0));
  EXPECT_EQ(line.points.front().y, 100.0);
  for (const Point& point : line.points) {
    const double p = point.x / 100.0;
    const double expected = std::pow(1.0 - p, 100) + 100.0 * p * std::pow(1.0 - p, 99);
    EXPECT_NEAR(point.y, 100.0 * expected, 1e-6) << p;
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
  EXPECT_THAT(
      html, AllOf(HasSubstr("<h2 id=\"spectra-section-title\">Spectra of the worst run"),
                  HasSubstr("a_c13: difference &lt;x&gt;"), HasSubstr("m/s²/√Hz"),
                  HasSubstr("an amplitude of 3×10⁻⁹ m/s²."),
                  HasSubstr("<td data-value=\"3e-09\">3×10⁻⁹</td>"), HasSubstr(">1.04 ± 0.03</td>"),
                  HasSubstr("It is white &amp; quiet."), Not(HasSubstr("<script>"))));
  review.spectra->sessions.clear();
  const std::string reasons = review_html(review);
  EXPECT_THAT(reasons, AllOf(HasSubstr("&lt;script&gt;"), Not(HasSubstr("bit for bit"))));
}

// One line of measured densities, one of what is left, one of the model; lines of the estimate and
// others apart.
TEST_F(ReviewHtml, DrawsASpectrumInFiveLayers) {
  const std::vector<Chart> charts = spectrum_charts(some_spectra());
  ASSERT_EQ(charts.size(), 1U);
  ASSERT_EQ(charts[0].layers.size(), 5U);
  for (const std::size_t i : {0U, 1U, 2U}) {
    EXPECT_EQ(std::get<Line>(charts[0].layers[i]).points.size(), 97U);
  }
  const auto& used = std::get<Markers>(charts[0].layers[3]);
  const auto& others = std::get<Markers>(charts[0].layers[4]);
  ASSERT_EQ(used.points.size(), 1U);
  ASSERT_EQ(others.points.size(), 1U);
  EXPECT_EQ(used.points[0].y, 4e-7);
  EXPECT_EQ(others.points[0].x, 5e-3);
}

TEST_F(ReviewHtml, KnowsTheWorstRun) {
  const Store store = store_with(20);
  Review review = review_of(store, 20);
  ASSERT_TRUE(worst_run_of(review).has_value());
  EXPECT_EQ(*worst_run_of(review), RunIndex{19});
  review.matrix.pop_back();  // All objectives together.
  EXPECT_FALSE(worst_run_of(review).has_value());
}

}  // namespace
}  // namespace proofmass::coordinator
