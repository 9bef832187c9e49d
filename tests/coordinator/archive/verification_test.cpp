#include "coordinator/archive/verification.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "coordinator/report/digest.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

using Verification = test::VerificationTest;

std::string flipped_estimate_sql(double estimate) {
  std::ostringstream sql;
  sql.precision(17);
  sql << "UPDATE run_result SET estimate_k2d_s2_m = " << estimate << " WHERE run_index = 17";
  return sql.str();
}

TEST_F(Verification, FindsAFileWithoutFault) {
  make_file();
  EXPECT_TRUE(verify_all());
  EXPECT_THAT(names(Verdict::fails), IsEmpty());
  EXPECT_THAT(names(Verdict::not_checked), IsEmpty());
  EXPECT_EQ(checks_.size(), 11U);
  EXPECT_THAT(check("file").finding, StartsWith("hardy2013, made 2"));
  EXPECT_EQ(check("definition").finding, "valid: seed 1, 18 runs");
  EXPECT_EQ(check("results").finding, "18 of 18 runs: each number obeys its rule");
  EXPECT_THAT(check("digest").details, ElementsAre(digest_of(Store::open_read_only(file()))));
  EXPECT_EQ(check("draws").finding, "of 18 runs made again: every truth is the same");
  EXPECT_EQ(check("simulation").finding, "18 of 18 runs simulated again: every bit is the same");
}

TEST_F(Verification, FindsAnEstimateThatIsOffByItsLastBit) {
  make_file();
  const double stored = results_[17].estimate[8];
  const double changed = std::nextafter(stored, 1e300);
  test::change(file(), flipped_estimate_sql(changed));
  EXPECT_FALSE(verify_all());
  // Also the list of worst runs, if the run is one of them.
  EXPECT_THAT(names(Verdict::fails), testing::IsSupersetOf({"digest", "simulation"}));
  EXPECT_EQ(check("digest").finding, "the results of 18 runs are not those it was made of");
  EXPECT_EQ(check("simulation").finding, "18 of 18 runs simulated again, of which 1 differs");
  ASSERT_EQ(check("simulation").details.size(), 3U);
  EXPECT_EQ(check("simulation").details[0], "run 17: estimate_k2d_s2_m");
  // Both values in full: they read back to their bits.
  const std::string of_stored = check("simulation").details[1];
  const std::string of_computed = check("simulation").details[2];
  ASSERT_THAT(of_stored, StartsWith("  stored    "));
  ASSERT_THAT(of_computed, StartsWith("  computed  "));
  EXPECT_EQ(test::bits_of(std::stod(of_stored.substr(12))), test::bits_of(changed));
  EXPECT_EQ(test::bits_of(std::stod(of_computed.substr(12))), test::bits_of(stored));
}

// What a disk that fails does: SQLite has no checksums, and its own check finds nothing.
TEST_F(Verification, FindsAByteOfAResultThatIsFlipped) {
  make_file();
  std::string bytes = test::content_of(file());
  std::string pattern(8, '\0');  // A double of a row, big-endian.
  const std::uint64_t bits = test::bits_of(results_[5].truth[3]);
  for (int i = 0; i < 8; ++i) pattern[std::size_t(i)] = static_cast<char>(bits >> (56 - 8 * i));
  const std::size_t position = bytes.find(pattern);
  ASSERT_NE(position, std::string::npos);
  bytes[position + 6] = static_cast<char>(bytes[position + 6] ^ 1);
  test::write_file(file(), bytes);
  EXPECT_FALSE(verify_all());
  EXPECT_EQ(check("integrity").verdict, Verdict::holds);
  EXPECT_THAT(names(Verdict::fails), ElementsAre("digest", "draws", "simulation"));
  EXPECT_EQ(check("draws").finding, "of 18 runs made again, of which 1 differs");
  EXPECT_THAT(check("draws").details, ElementsAre(StartsWith("run 5: truth_a_c12_rad = ")));
  EXPECT_EQ(check("simulation").details.at(0), "run 5: truth_a_c12_rad");
}

TEST_F(Verification, FindsAPageThatIsOverwritten) {
  make_file();
  std::string bytes = test::content_of(file());
  constexpr std::size_t page = 4096;
  ASSERT_GT(bytes.size(), 2 * page);
  // The second page is the first table's.
  for (std::size_t at = page; at < 2 * page; ++at) bytes[at] = static_cast<char>(at);
  test::write_file(file(), bytes);
  EXPECT_FALSE(verify_all());
  EXPECT_EQ(check("file").verdict, Verdict::fails);
  EXPECT_THAT(check("file").finding, HasSubstr("damaged"));
  EXPECT_THAT(names(Verdict::not_checked),
              ElementsAre("audit", "definition", "digest", "draws", "integrity", "model", "results",
                          "simulation", "statistics", "stop_checks"));
  EXPECT_EQ(check("digest").finding, "the file cannot be opened");
}

TEST_F(Verification, FindsAnotherDefinition) {
  make_file();
  test::change(file(),
               "UPDATE campaign SET definition = replace(definition, 'damping = 0.8', 'damping = "
               "0.7')");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(Verdict::fails), ElementsAre("definition", "simulation"));
  EXPECT_THAT(check("definition").details,
              ElementsAre(AllOf(StartsWith("campaign.table_digest = "), HasSubstr(" (must be "))));
  EXPECT_EQ(check("simulation").finding, "18 of 18 runs simulated again, of which 18 differ");
  EXPECT_EQ(check("simulation").details.size(), 31U) << "ten differences, and how many more";
  EXPECT_THAT(check("simulation").details.back(), AllOf(StartsWith("and "), HasSubstr(" more")));
}

TEST_F(Verification, FindsADefinitionOfAnotherCampaign) {
  make_file();
  test::change(file(), "UPDATE campaign SET seed = '2'");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(Verdict::fails), ElementsAre("definition"));
  EXPECT_EQ(check("definition").finding, "campaign.seed = 2 (must be 1, as in the definition)");
}

TEST_F(Verification, FindsADefinitionThatIsNone) {
  make_file();
  test::change(file(), "UPDATE campaign SET definition = 'nonsense'");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(Verdict::fails), ElementsAre("definition"));
  EXPECT_THAT(names(Verdict::not_checked),
              ElementsAre("digest", "draws", "results", "simulation", "statistics", "stop_checks"));
  EXPECT_EQ(check("results").finding, "the definition cannot be read");
  EXPECT_EQ(check("digest").finding, "the results cannot be read");
}

TEST_F(Verification, FindsAResultThatIsMissing) {
  make_file();
  test::change(file(), "PRAGMA foreign_keys = OFF; DELETE FROM run_result WHERE run_index = 4");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(Verdict::fails), ElementsAre("digest", "integrity", "results"));
  EXPECT_THAT(check("integrity").finding, HasSubstr("refers to no row of run_result"));
  EXPECT_EQ(check("results").finding, "17 of 18 runs: 1 rule is broken");
  EXPECT_THAT(check("results").details, ElementsAre("run 4: has a delivery and no result"));
  EXPECT_EQ(check("digest").finding, "it is of 18 runs, of which 17 are in the file");
}

TEST_F(Verification, FindsAResultThatIsMissingWithItsDelivery) {
  make_file();
  test::change(file(),
               "DELETE FROM delivery WHERE run_index = 4;"
               "DELETE FROM run_result WHERE run_index = 4");
  EXPECT_FALSE(verify_all());
  EXPECT_EQ(check("results").verdict, Verdict::holds);
  EXPECT_EQ(check("digest").finding, "it is of 18 runs, of which 17 are in the file");
}

TEST_F(Verification, FindsAResultThatNobodyDelivered) {
  make_file();
  test::change(file(), "DELETE FROM delivery WHERE run_index = 4");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(check("results").details, ElementsAre("run 4: has a result and no delivery"));
}

TEST_F(Verification, FindsNumbersThatNoSimulationYields) {
  campaign_.scenario.estimation.num_rounds_max = 50;
  results_[0].num_draws = 0;
  results_[1].num_rounds = 51;
  results_[2].status = RunStatus::not_converged;
  results_[2].num_rounds = 49;
  results_[4].status = RunStatus::no_draw;
  results_[4].num_draws = 7;
  results_[4].num_rounds = 5;
  make_file();
  test::change(file(), "UPDATE run_result SET truth_a_c12_rad = 9e999 WHERE run_index = 3");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(check("results").details,
              testing::IsSupersetOf({"run 0: num_draws = 0 (must be 1 to 1000 if completed)",
                                     "run 1: num_rounds = 51 (must be 0 to 50 if completed)",
                                     "run 2: num_rounds = 49 (must be 50 to 50 if not_converged)",
                                     "run 3: truth_a_c12_rad = inf (must be in [-1e+90, 1e+90])",
                                     "run 4: num_draws = 7 (must be 1000 to 1000 if no_draw)",
                                     "run 4: num_rounds = 5 (must be 0 to 0 if no_draw)"}));
}

TEST_F(Verification, FindsARunBeyondTheLast) {
  make_file();
  test::change(file(),
               "UPDATE run_result SET run_index = 18 WHERE run_index = 4;"
               "UPDATE delivery SET run_index = 18 WHERE run_index = 4");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(check("results").finding, HasSubstr("is damaged: result of run 18, of 18 there are"));
  EXPECT_EQ(check("simulation").finding, "the results cannot be read");
}

TEST_F(Verification, NamesTheFirstOfManyBrokenRules) {
  make_file();
  test::change(file(), "UPDATE run_result SET num_draws = 0");
  EXPECT_FALSE(verify_all());
  EXPECT_EQ(check("results").finding, "18 of 18 runs: 18 rules are broken");
  EXPECT_EQ(check("results").details.size(), 11U);
  EXPECT_EQ(check("results").details.back(), "and 8 more");
}

TEST_F(Verification, CannotSimulateWhatAnotherModelComputed) {
  make_file();
  test::change(file(), "UPDATE campaign SET model_version = 'older'");
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(Verdict::fails), ElementsAre("definition", "model"));
  EXPECT_EQ(check("model").finding, "older made this file and this program has " +
                                        std::string(model_version) +
                                        ": its runs cannot be simulated again");
  EXPECT_THAT(names(Verdict::not_checked), ElementsAre("draws", "simulation"));
  EXPECT_EQ(check("simulation").finding, "another model made the file");
}

TEST_F(Verification, SaysWhatItCannotCheckWhileTheFileIsServed) {
  Store store = test::store_of(file(), campaign_, {results_.begin(), results_.begin() + 2});
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("digest").finding, "none is stored: a coordinator has the file, or was killed");
  update_statistics(store, campaign_);
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("digest").verdict, Verdict::holds);
  const Delivery third{.result = results_[2], .worker = test::session_1, .attempt = {1}};
  (void)store.commit({&third, 1});
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("digest").finding,
            "it is of 2 runs and 3 are finished: a coordinator has the file, or was killed");
  EXPECT_EQ(check("simulation").finding, "3 of 3 runs simulated again: every bit is the same");
}

TEST_F(Verification, OfAFileWithoutResultsSimulatesNone) {
  (void)test::store_of(file(), campaign_, {});
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("simulation").verdict, Verdict::not_checked);
  EXPECT_EQ(check("simulation").finding, "no run is finished");
}

TEST_F(Verification, CanBeInterrupted) {
  make_file();
  EXPECT_THROW(
      (void)verify(
          file(), {}, [](const Check&) { FAIL() << "nothing is checked"; }, [] { return true; }),
      Interrupted);
}

TEST_F(Verification, CanBeInterruptedWhileItSimulates) {
  make_file();
  std::string last;
  int num_questions = 0;
  const auto report = [&](const Check& check) { last = check.name; };
  // The first question is asked before the simulation, the second while its results are read.
  const auto is_stopped = [&] { return last == "draws" && ++num_questions > 2; };
  EXPECT_THROW((void)verify(file(), {.fraction = 1.0}, report, is_stopped), Interrupted);
  EXPECT_EQ(last, "draws");
}

TEST_F(Verification, NeedsACampaignFileAndAFraction) {
  const auto ignore = [](const Check&) {};
  const std::string path = file().string();
  EXPECT_EQ(test::error_of([&] { (void)verify(file(), {}, ignore, test::never_stopped); }),
            "campaign database = " + path + " (does not exist)");
  test::write_file(file(), "something else");
  EXPECT_EQ(test::error_of([&] { (void)verify(file(), {}, ignore, test::never_stopped); }),
            "campaign database = " + path + " (is not a Proofmass campaign)");
  for (const double fraction : {-0.1, 1.1, std::nan("")}) {
    EXPECT_THAT(test::error_of([&] {
                  (void)verify(file(), {.fraction = fraction}, ignore, test::never_stopped);
                }),
                AllOf(StartsWith("fraction = "), HasSubstr(" (must be in [0, 1])")));
  }
}

TEST(CheckText, IsALineAndItsDetails) {
  EXPECT_EQ(check_text({.name = "digest", .finding = "of 18 runs", .details = {"abc"}}),
            "digest      ok           of 18 runs\n  abc\n");
  EXPECT_EQ(
      check_text({.name = "model", .verdict = Verdict::fails, .finding = "no", .details = {}}),
      "model       FAILS        no\n");
}

TEST(CheckText, BreaksLinesBetweenWords) {
  std::string finding;
  for (int i = 0; i < 40; ++i) finding += "seven77 ";
  std::istringstream lines(check_text(
      {.name = "digest", .verdict = Verdict::not_checked, .finding = finding, .details = {}}));
  std::size_t num_lines = 0, num_words = 0;
  for (std::string line; std::getline(lines, line); ++num_lines) {
    EXPECT_LE(display_width(line), 80U);
    for (std::size_t at = 0; (at = line.find("seven77", at)) != std::string::npos; ++at) {
      ++num_words;
    }
  }
  EXPECT_EQ(num_words, 40U);
  EXPECT_EQ(num_lines, 6U);  // Seven words and six spaces are 55.
}

}  // namespace
}  // namespace proofmass::coordinator
