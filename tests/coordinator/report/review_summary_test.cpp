#include "coordinator/report/review_summary.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <string>
#include <vector>

#include "coordinator/report/review_html.hpp"
#include "tests/coordinator/report/review_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;

class ReviewSummary : public test::ReviewTest {
 protected:
  static std::vector<std::string> sentences_of(const Review& review) {
    std::vector<std::string> texts;
    for (const SummarySentence& sentence : review_summary(review)) texts.push_back(sentence.text);
    EXPECT_EQ(texts.size(), 5U);
    return texts;
  }
};

// Of 100 runs the error of run r is (r + 1) % of each objective, see review_html_test.cpp.
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
                {{.id = "A", .text = "", .requirement = "k2c < 901 for 99% with 90%"},
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
  review.num_given_up = review.missing.num_given_up = 1;
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
  EXPECT_THAT(sentences_of(review)[3],
              HasSubstr("; no drawn quantity or product of two explains it."));
  review.causes->terms = {{.quantity = 0, .name = "true a × b", .slope = 1.0, .share = 0.982},
                          {.quantity = 0, .name = "c", .slope = 1.0, .share = 0.01}};
  EXPECT_THAT(sentences_of(review)[3],
              HasSubstr("100 nm or 100 % of its objective; of the variance of this error over the "
                        "draws, 98.2 % follows from true a × b."));
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

}  // namespace
}  // namespace proofmass::coordinator
