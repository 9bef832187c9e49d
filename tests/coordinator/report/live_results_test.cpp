#include "coordinator/report/live_results.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "coordinator/report/report_tables.hpp"
#include "core/model.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// Results of a database, one after the other.
class LiveResultsTest : public test::ReviewTest {
 protected:
  static LiveResults results_in(const Store& store) {
    LiveResults results(test::campaign_of(1));
    store.for_each_result([&](const RunResult& result) { results.add(result); });
    return results;
  }
};

// A review reads the same results in passes, and its statistics are of another method.
TEST_F(LiveResultsTest, ShowTheTableOfAReview) {
  const Store store = store_with(150);
  const std::string html = results_in(store).html();
  EXPECT_EQ(test::malformed_part(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("id=\"accuracy\""), HasSubstr("id=\"errors-title\""),
                          Not(HasSubstr("<html"))));
  const Review review = review_of(store, 150);
  for (const Row& row : accuracy_table(review.objectives, review.results.statistics).rows) {
    for (const Cell& cell : row) {
      EXPECT_THAT(html, HasSubstr(">" + wire::markup_text(cell.in_document()) + "<"));
    }
  }
  EXPECT_THAT(html, HasSubstr("50 runs exceed the objective"));  // 101 to 150 % of it.
}

TEST(LiveResults, AreEmptyAtFirst) {
  const LiveResults results(test::campaign_of(1));
  EXPECT_EQ(test::malformed_part(results.html()), "");
  EXPECT_THAT(results.html(), HasSubstr("no data"));
}

}  // namespace
}  // namespace proofmass::coordinator
