#include "coordinator/archive/verification.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using Verification = test::VerificationTest;

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

TEST_F(Verification, SaysWhatItCannotCheckWhileTheFileIsServed) {
  Store store = test::store_of(file(), campaign_, {results_.begin(), results_.begin() + 2});
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("digest").finding, "none is stored: a coordinator has the file, or was killed");
  update_statistics(store, campaign_);
  EXPECT_TRUE(verify_all());
  EXPECT_EQ(check("digest").verdict, CheckOutcome::holds);
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
  EXPECT_EQ(check("simulation").verdict, CheckOutcome::not_checked);
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

TEST(CheckText, IsALineAndItsDetails) {
  EXPECT_EQ(check_text({.name = "digest", .finding = "of 18 runs", .details = {"abc"}}),
            "digest      ok           of 18 runs\n  abc\n");
  EXPECT_EQ(
      check_text({.name = "model", .verdict = CheckOutcome::fails, .finding = "no", .details = {}}),
      "model       FAILS        no\n");
}

TEST(CheckText, BreaksLinesBetweenWords) {
  std::string finding;
  for (int i = 0; i < 40; ++i) finding += "seven77 ";
  std::istringstream lines(check_text(
      {.name = "digest", .verdict = CheckOutcome::not_checked, .finding = finding, .details = {}}));
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
