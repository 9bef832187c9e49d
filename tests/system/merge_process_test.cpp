// A campaign that is computed in parts, by processes that know nothing of each other.

#include <gtest/gtest.h>
#include <signal.h>

#include <string>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

class MergeProcess : public CampaignProcess {
 protected:
  /// Computes the runs A to B - 1 into the database B.db.
  [[nodiscard]] Process start_part(const std::string& first, const std::string& end) const {
    return start(end, {"--workers", "2", "--range", first + ":" + end});
  }

  [[nodiscard]] int merge(const Arguments& parts) const {
    Arguments arguments{"merge", "whole.db"};
    arguments.insert(arguments.end(), parts.begin(), parts.end());
    return Process(directory / "", "merge", programs + "/proofmass", arguments).wait();
  }

  /// The line of `proofmass report` that has the digest.
  [[nodiscard]] std::string digest_line_of(const std::string& database) const {
    EXPECT_EQ(
        Process(directory / "", "report", programs + "/proofmass", {"report", database}).wait(), 0);
    const std::string text = read_file(path("report.out"));
    const std::size_t begin = text.find("Digest ");
    return text.substr(begin, text.find('\n', begin) - begin);
  }
};

TEST_F(MergeProcess, PartsOfThreeSizesOneOfThemKilledMakeTheWhole) {
  EXPECT_EQ(start_part("0", "7").wait(), 0) << errors_of("7");
  EXPECT_EQ(num_stored(path("7.db")), 7U);
  EXPECT_EQ(errors_of("7").find("0/7 runs"), 0U) << errors_of("7");

  Process killed = start_part("7", "200");
  wait_for_runs("200", 2);
  killed.signal_all(SIGKILL);
  EXPECT_EQ(killed.wait(), -SIGKILL);
  ASSERT_LT(num_stored(path("200.db")), 193U);
  EXPECT_EQ(start_part("7", "200").wait(), 0) << errors_of("200");
  EXPECT_EQ(num_stored(path("200.db")), 193U);

  Process interrupted = start_part("200", "320");
  wait_for_runs("320", 2);
  interrupted.signal_all(SIGINT);
  EXPECT_EQ(interrupted.wait(), 130);
  EXPECT_TRUE(contains(errors_of("320"), " of 120 runs are in 320.db\n")) << errors_of("320");
  EXPECT_EQ(start_part("200", "320").wait(), 0) << errors_of("320");

  EXPECT_EQ(merge({"320.db", "7.db", "200.db"}), 0) << errors_of("merge");
  EXPECT_EQ(stored_runs(path("whole.db")), reference());
  EXPECT_EQ(digest_line_of("whole.db"), digest_line_of("reference.db"));
}

// What is missing in a merged database, `run` computes as in any other.
TEST_F(MergeProcess, AGapIsComputedAfterwards) {
  EXPECT_EQ(start_part("0", "30").wait(), 0) << errors_of("30");
  EXPECT_EQ(start_part("300", "320").wait(), 0) << errors_of("320");
  EXPECT_EQ(merge({"30.db", "320.db"}), 0) << errors_of("merge");
  EXPECT_TRUE(contains(read_file(path("merge.out")), "270 of 320 runs are in no part: 30..299\n"));
  EXPECT_EQ(start("whole", {}).wait(), 0) << errors_of("whole");
  EXPECT_EQ(stored_runs(path("whole.db")), reference());
}

// Several ranges of one database.
TEST_F(MergeProcess, FurtherRangesGoIntoTheSameDatabase) {
  EXPECT_EQ(start("same", {"--range", "100:150"}).wait(), 0) << errors_of("same");
  EXPECT_EQ(start("same", {"--range", "0:120"}).wait(), 0) << errors_of("same");
  EXPECT_EQ(errors_of("same").find("20/120 runs"), 0U) << errors_of("same");
  EXPECT_EQ(stored_text(path("same.db"), "SELECT phase FROM campaign"), "active");
  EXPECT_EQ(start("same", {"--range", "120:320"}).wait(), 0) << errors_of("same");
  EXPECT_EQ(stored_runs(path("same.db")), reference());
  EXPECT_EQ(stored_text(path("same.db"), "SELECT phase FROM campaign"), "finished");
}

}  // namespace
}  // namespace proofmass::test
