#include "coordinator/archive/verification.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using Verification = test::VerificationTest;

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
