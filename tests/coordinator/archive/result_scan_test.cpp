#include <fmt/format.h>

#include "coordinator/archive/verification.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/table/table.hpp"
#include "tests/coordinator/archive/verification_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

// What a campaign database keeps beside its results, and what verification says if it is not so.

class DerivedChecks : public test::VerificationTest {
 protected:
  /// Changes a finished campaign as anybody with SQL can; returns which checks fail.
  std::vector<std::string> failing_after(const std::string& sql) {
    if (!std::filesystem::exists(file())) make_file();
    test::change(file(), sql);
    return failing({.fraction = 0.0});
  }
};

// Nobody can tell which results these are of.
TEST_F(DerivedChecks, DoNotHoldStatisticsOfOtherResults) {
  EXPECT_THAT(failing_after("UPDATE summary SET num_finished = 17, num_estimated = 17"), IsEmpty());
  EXPECT_EQ(check("statistics").verdict, CheckOutcome::not_checked);
  EXPECT_EQ(check("statistics").finding, "they are not of the results that are in the file");
}

TEST_F(DerivedChecks, HoldForRunsThatFailed) {
  results_[0].status = RunStatus::not_finite;
  results_[1].status = RunStatus::no_draw;
  results_[1].num_draws = 1000;
  results_[1].num_rounds = 0;
  make_file();
  EXPECT_THAT(failing({.fraction = 0.0}), IsEmpty()) << "simulates run 9";
  EXPECT_THAT(names(CheckOutcome::not_checked), IsEmpty());
  EXPECT_THAT(failing_after("UPDATE summary SET num_not_finite = 0"), ElementsAre("statistics"));
}

TEST_F(DerivedChecks, HoldIfEveryRunFailed) {
  campaign_.scenario.acceptance.a_d11_max = 1e-300;
  results_ = test::simulated(campaign_);
  make_file();
  EXPECT_THAT(failing(), IsEmpty());
  EXPECT_THAT(names(CheckOutcome::not_checked), IsEmpty());
  EXPECT_EQ(text("SELECT num_no_draw || ' ' || num_estimated FROM summary"), "18 0");
  EXPECT_THAT(failing_after("UPDATE budget_entry SET after_worst = 1 WHERE term = 'total'"),
              ElementsAre("statistics"));
  EXPECT_THAT(check("statistics").details,
              ElementsAre("budget_entry.after_worst of total = 1 (must be NULL)"));
}

// A run may be given up after the statistics, without another result.
TEST_F(DerivedChecks, HoldIfARunIsGivenUpLater) {
  results_.pop_back();
  {
    Store store = test::store_of(file(), campaign_, results_);
    update_statistics(store, campaign_);
    const Entry given_up = GivenUpRun{.run = RunIndex{17}};
    (void)store.write({&given_up, 1});
  }
  EXPECT_THAT(failing(), IsEmpty());
  EXPECT_EQ(check("statistics").verdict, CheckOutcome::holds);
}

// A campaign that ends between two checks.
TEST_F(DerivedChecks, AreOfOneStateOfTheFile) {
  Store store = test::store_of(file(), campaign_, {results_.begin(), results_.begin() + 17});
  const auto end_campaign = [&](const Check& check) {
    checks_.emplace(check.name, check);
    if (check.name != "results") return;
    const Delivery last{.result = results_[17], .worker = test::session_1, .attempt = {1}};
    (void)store.commit({&last, 1});
    update_statistics(store, campaign_);
  };
  verify(file(), {.fraction = 0.0}, end_campaign, test::never_stopped);
  EXPECT_THAT(names(CheckOutcome::fails), IsEmpty());
  EXPECT_EQ(check("statistics").finding,
            "none are stored: a coordinator has the file, or was killed");
}

TEST_F(DerivedChecks, FindResultsThatContradictEachOther) {
  {
    Store store = test::store_of(file(), campaign_, results_);
    update_statistics(store, campaign_);
    Delivery second{.result = results_[5], .worker = {7}, .attempt = {2}};
    second.result.estimate[0] *= 2.0;
    const std::vector<Entry> entries{WorkerJoined{.session = {7}, .name = "liar", .host = "h"},
                                     SecondDelivery{second}};
    (void)store.write(entries);
  }
  EXPECT_THAT(failing(), ElementsAre("audit"));
  EXPECT_EQ(check("audit").finding,
            "1 of 1 second results is not the stored one: a worker computes wrongly");
  EXPECT_THAT(check("audit").details,
              ElementsAre(fmt::format("run 5: liar delivered {} (must be {}, as stored)",
                                      text("SELECT second_digest FROM audit"),
                                      text("SELECT stored_digest FROM audit"))));
}

/// A campaign of 18 runs that was asked to stop by a rule, and has ended.
class DerivedStopChecks : public DerivedChecks {
 protected:
  DerivedStopChecks() { make_file_with_rule("std(a_c13) within 50%"); }

  void make_file_with_rule(const std::string& rule) {
    Store store = test::store_of(file(), campaign_, results_);
    decide(store, rule);
  }
  void decide(Store& store, const std::string& rule) {
    store.set_stop_plan({.stop_rule = rule, .num_runs_max = 18, .failures_max = {}});
    (void)summarise_file(file(), campaign_,
                         [&](const std::function<void(Store&)>& action) { action(store); });
    const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
    (void)store.write({&finished, 1});
  }
};

TEST_F(DerivedStopChecks, Hold) {
  EXPECT_THAT(failing_after(""), IsEmpty());
  EXPECT_EQ(check("stop_checks").finding, "1 of a stop rule");
}

// Nothing of a plan that was changed is deleted, and it asked for another width.
TEST_F(DerivedStopChecks, HoldAfterTheRuleWasChanged) {
  {
    Store store = Store::open(file());
    decide(store, "mean(k2c) within 1%");
    decide(store, "mean(k2c) within 99%");
    store.set_stop_plan(
        {.stop_rule = "mean(k2c) within 2%", .num_runs_max = 18, .failures_max = {}});
    EXPECT_EQ(store.control().phase, wire::CampaignPhase::active) << "until it is checked";
  }
  EXPECT_THAT(failing_after(""), IsEmpty());
  EXPECT_EQ(check("stop_checks").finding, "2 of a stop rule");
}

// Its result came after the check, which was of the others.
TEST_F(DerivedStopChecks, HoldIfARunHadBeenGivenUp) {
  std::filesystem::remove(file());
  const RunResult last = results_.back();
  results_.pop_back();
  make_file_with_rule("std(a_c13) within 50%");
  {
    Store store = Store::open(file());
    const std::vector<Entry> entries{ReturnedRuns{.runs = {RunIndex{17}, 1},
                                                  .attempt = {1},
                                                  .worker = test::session_1,
                                                  .reason = wire::LossReason::crashed,
                                                  .is_blamed = true},
                                     GivenUpRun{.run = RunIndex{17}}};
    (void)store.write(entries);
  }
  EXPECT_THAT(failing_after(""), IsEmpty()) << "given up";
  {
    Store store = Store::open(file());
    const Delivery late{.result = last, .worker = test::session_1, .attempt = {2}};
    (void)store.commit({&late, 1});
  }
  EXPECT_THAT(failing_after(""), IsEmpty()) << "finished";
}

using Verification = test::VerificationTest;

TEST_F(Verification, SaysWhatItCannotCheckWhileTheFileIsServed) {
  Store store = test::store_of(file(), campaign_, {results_.begin(), results_.begin() + 2});
  EXPECT_THAT(failing(), IsEmpty());
  EXPECT_EQ(check("digest").finding, "none is stored: a coordinator has the file, or was killed");
  update_statistics(store, campaign_);
  EXPECT_THAT(failing(), IsEmpty());
  EXPECT_EQ(check("digest").verdict, CheckOutcome::holds);
  const Delivery third{.result = results_[2], .worker = test::session_1, .attempt = {1}};
  (void)store.commit({&third, 1});
  EXPECT_THAT(failing(), IsEmpty());
  EXPECT_EQ(check("digest").finding,
            "it is of 2 runs and 3 are finished: a coordinator has the file, or was killed");
  EXPECT_EQ(check("simulation").finding, "3 of 3 runs simulated again: every bit is the same");
}

TEST_F(Verification, OfAFileWithoutResultsSimulatesNone) {
  (void)test::store_of(file(), campaign_, {});
  EXPECT_THAT(failing(), IsEmpty());
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
