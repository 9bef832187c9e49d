#include <fmt/format.h>

#include "coordinator/archive/verification.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/summarise.hpp"
#include "coordinator/table/terminal_table.hpp"
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
    const bool holds = verify_all(0.0);
    const std::vector<std::string> failing = names(CheckOutcome::fails);
    EXPECT_EQ(holds, failing.empty());
    return failing;
  }

  struct Change {
    std::string sql;
    std::vector<std::string> failing;  ///< Checks.
    std::vector<std::string> details;  ///< What those of the first one begin with.
  };
  void expect_found(const std::vector<Change>& changes) {
    if (!std::filesystem::exists(file())) make_file();
    const std::string whole = test::content_of(file());
    for (const auto& [sql, failing, details] : changes) {
      test::write_file(file(), whole);
      EXPECT_EQ(failing_after(sql), failing) << sql;
      const std::vector<std::string>& found = check(failing.front()).details;
      ASSERT_THAT(found, SizeIs(details.size())) << sql;
      for (std::size_t i = 0; i < details.size(); ++i) {
        EXPECT_THAT(found[i], StartsWith(details[i])) << sql;
      }
    }
  }
};

TEST_F(DerivedChecks, FindAStatisticThatDoesNotFollowFromTheResults) {
  make_file();
  const std::string mean =
      text("SELECT format('%!.17g', mean) FROM statistic WHERE parameter = 'k2d'");
  EXPECT_THAT(failing_after("UPDATE statistic SET mean = 1"), ElementsAre("statistics"));
  EXPECT_EQ(check("statistics").finding, "not what follows from definition and results");
  ASSERT_THAT(check("statistics").details, SizeIs(10));
  const std::string of_k2d = check("statistics").details[8];
  ASSERT_THAT(of_k2d, StartsWith("statistic.mean of k2d = 1 (must be "));
  EXPECT_DOUBLE_EQ(std::stod(of_k2d.substr(of_k2d.find("must be ") + 8)), std::stod(mean));
}

TEST_F(DerivedChecks, FindWhatDoesNotFollow) {
  const std::string interval =
      "summary.within_objectives_lower and _upper (must be those of num_within_objectives)";
  std::vector<std::string> all_and_more(10, "statistic has a row too many: ");
  all_and_more.emplace_back("and ");
  std::vector<std::string> lacking(10, "statistic lacks ");
  std::vector<std::string> lacking_more = lacking;
  lacking_more.emplace_back("and 11 more");
  expect_found(
      {{"INSERT INTO run_warning VALUES (0, 'spin', 'k2d', 0.5)",
        {"statistics"},
        {"run_warning has a row too many: spin on k2d in run 0"}},
       // By more than rounding.
       {"UPDATE statistic SET skewness = skewness * (1 + 2e-12) WHERE parameter = 'a_d12'",
        {"statistics"},
        {"statistic.skewness of a_d12"}},
       {"UPDATE statistic SET bias_lower = NULL WHERE parameter = 'a_c13'",
        {"statistics"},
        {"statistic.bias_lower of a_c13 = NULL (must be "}},
       {"DELETE FROM statistic", {"statistics"}, lacking},
       {"DELETE FROM statistic; DELETE FROM budget_entry", {"statistics"}, lacking_more},
       {"DELETE FROM summary", {"statistics"}, all_and_more},
       {"UPDATE budget_entry SET term = 'own' WHERE term = 'residual_y'",
        {"statistics"},
        {"budget_entry lacks residual_y", "budget_entry has a row too many: own"}},
       {"UPDATE summary SET num_no_draw = 5, num_estimated = 13, num_not_converged = 2,"
        " num_not_finite = 3, num_given_up = 4",
        {"statistics"},
        {"summary.num_estimated = 13 (must be 18)", "summary.num_not_converged = 2 (must be 0)",
         "summary.num_not_finite = 3 (must be 0)", "summary.num_no_draw = 5 (must be 0)", interval,
         "summary.num_given_up = 4 (must be at most 0)"}},
       {"UPDATE summary SET num_finished = 17",
        {"statistics"},
        {"summary.num_finished = 17 (must be 18, the sum of its kinds)"}},
       {"INSERT INTO audit VALUES (5, 1, 0, '0000000000000000', '1111111111111111', 0)",
        {"audit", "integrity"},
        {"run 5: "}}});
}

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
  EXPECT_TRUE(verify_all(0.0)) << "simulates run 9";
  EXPECT_THAT(names(CheckOutcome::not_checked), IsEmpty());
  EXPECT_THAT(failing_after("UPDATE summary SET num_not_finite = 0"), ElementsAre("statistics"));
}

TEST_F(DerivedChecks, HoldIfEveryRunFailed) {
  campaign_.scenario.acceptance.a_d11_max = 1e-300;
  results_ = test::simulated(campaign_);
  make_file();
  EXPECT_TRUE(verify_all());
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
  EXPECT_TRUE(verify_all());
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
  EXPECT_TRUE(verify(file(), {.fraction = 0.0}, end_campaign, test::never_stopped));
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
  EXPECT_FALSE(verify_all());
  EXPECT_THAT(names(CheckOutcome::fails), ElementsAre("audit"));
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

TEST_F(DerivedStopChecks, FindWhatDoesNotFollow) {
  const std::string check = " of std(a_c13) after 18 runs = ";
  expect_found(
      {{"UPDATE stop_check SET estimate = 1, upper = NULL",
        {"stop_checks"},
        {"stop_check.estimate" + check + "1 (must be ",
         "stop_check.upper" + check + "NULL (must be "}},
       {"DELETE FROM stop_check", {"stop_checks"}, {"stop_check lacks std(a_c13) after 18 runs"}},
       {"INSERT INTO stop_check VALUES ('max(k2c)', 18, 1, 1, 1, 0, 1, '');"
        "INSERT INTO stop_check VALUES ('p9(k2c)', 128, 1, 1, 1, 0, 1, '');"
        "INSERT INTO stop_check VALUES ('mean(k2c)', 10, 1, 1, 1, 0.1, 1, '')",
        {"stop_checks"},
        {"stop_check.statistic = max(k2c) (must be that of a stop rule)",
         "stop_check.num_runs of p9(k2c) = 128 (must be at most 18)",
         "stop_check.estimate of mean(k2c) after 10 runs = 1 (must",
         "stop_check.lower of mean(k2c) after 10 runs",
         "stop_check.upper of mean(k2c) after 10 runs",
         "stop_check.relative_half_width of mean(k2c)"}}});
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
