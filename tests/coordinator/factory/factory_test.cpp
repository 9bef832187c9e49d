#include "coordinator/factory/factory.hpp"

#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

/// A factory whose coordinator and queue a test sets by hand, in a time of its own.
class FactoryTest : public testing::Test {
 protected:
  FactoryActions look() {
    return on_view(state_, config_, view_, now_,
                   [this](const wire::Event& event) { events_.push_back(to_text(event)); });
  }

  /// What the batch system does with the next submission: it waits in the queue.
  void submit(const std::string& id) {
    on_submitted(state_, id, now_);
    view_.allocations.push_back({id, false});
  }

  void run(std::size_t i) { view_.allocations.at(i).is_running = true; }
  void enter(const std::string& id) { view_.workers.insert(config_.name + "-" + id); }
  void fail_submission() {
    on_submission_failed(state_, "sbatch: no such partition", now_, [](const wire::Event&) {});
  }

  FactoryConfig config_{.walltime = std::chrono::hours(1)};
  FactoryState state_;
  FactoryView view_{.num_open_runs = 100'000};
  FactoryTime now_{std::chrono::hours(24)};
  std::vector<std::string> events_;
};

// With N open runs, a rate r of one worker, a walltime W and a share u, each of n workers is busy
// for N/(n·r) s; that is at least u·W up to n = N/(r·u·W).
TEST_F(FactoryTest, WantsAsManyWorkersAsFindWorkForTheirShareOfTheWalltime) {
  const double rate_hz = 0.5;
  config_.workers_max = 10'000;
  for (const double share : {0.05, 0.1, 1.0}) {
    config_.utilisation_min = share;
    const std::uint64_t num_wanted = wanted_workers(config_, view_, rate_hz);
    const auto busy_s = [&](std::uint64_t n) {
      return 100'000.0 / (static_cast<double>(n) * rate_hz);
    };
    EXPECT_GE(busy_s(num_wanted), share * 3600.0);
    EXPECT_LT(busy_s(num_wanted + 1), share * 3600.0);
  }
}

TEST_F(FactoryTest, WantsNobodyWithoutOpenRunsAndKeepsItsLimitsElsewhere) {
  config_.workers_min = 2;
  config_.workers_max = 7;
  EXPECT_EQ(wanted_workers(config_, view_, 1e-6), 7u);
  EXPECT_EQ(wanted_workers(config_, view_, 1e9), 2u);
  view_.num_open_runs = 0;
  EXPECT_EQ(wanted_workers(config_, view_, 1e-6), 0u);
}

TEST_F(FactoryTest, TriesOneWorkerBeforeItKnowsARate) {
  EXPECT_EQ(look().num_submissions, 1u);
  submit("1");
  EXPECT_EQ(look().num_submissions, 0u);
  run(0);
  enter("1");
  EXPECT_EQ(look().num_submissions, 0u);  // It has finished no run yet.
  view_.rate_hz = 0.01;
  EXPECT_EQ(look().num_submissions, 1u);
}

TEST_F(FactoryTest, KeepsItsBacklogAndItsNumberOfWorkers) {
  config_.backlog = 2;
  config_.workers_max = 3;
  state_.rate_per_worker_hz = 1e-3;
  EXPECT_EQ(look().num_submissions, 2u);
  submit("1");
  submit("2");
  EXPECT_EQ(look().num_submissions, 0u);
  for (const std::size_t i : {0u, 1u}) run(i);
  EXPECT_EQ(look().num_submissions, 0u);  // They run, but nobody has registered.
  enter("1");
  enter("2");
  EXPECT_EQ(look().num_submissions, 1u);
}

TEST_F(FactoryTest, CountsWorkersThatOthersStarted) {
  state_.rate_per_worker_hz = 1e-3;
  config_.workers_max = 2;
  view_.workers = {"a", "b"};
  EXPECT_EQ(look().num_submissions, 0u);
}

// The coordinator has lost them, but the batch system says that they run: they may come back.
TEST_F(FactoryTest, CountsAllocationsWhoseWorkersAreLostAgainstItsNumber) {
  state_.rate_per_worker_hz = 1e-3;
  config_.workers_max = 2;
  for (const std::string id : {"1", "2"}) {
    submit(id);
    enter(id);
  }
  (void)look();
  view_.workers.clear();
  EXPECT_EQ(look().num_submissions, 0u);
  config_.workers_max = 3;
  EXPECT_EQ(look().num_submissions, 1u);
}

TEST_F(FactoryTest, CancelsWhatWaitsWhenThereIsNoWorkLeft) {
  config_.backlog = 3;
  state_.rate_per_worker_hz = 1e-3;
  for (const std::string id : {"1", "2", "3"}) submit(id);
  run(0);
  view_.num_open_runs = 0;
  EXPECT_THAT(look().cancelled, ElementsAre("3", "2"));
  EXPECT_THAT(look().cancelled, IsEmpty());  // Once is enough.
  // They are gone from the queue, and that is nobody's failure.
  view_.allocations.resize(1);
  now_ += minutes(2);
  (void)look();
  EXPECT_THAT(events_, IsEmpty());
}

TEST_F(FactoryTest, FindsWhatAFactoryOfItsNameLeftInTheQueue) {
  state_.rate_per_worker_hz = 1e-3;
  view_.allocations = {{"7", false}};
  EXPECT_EQ(look().num_submissions, 0u);
}

TEST_F(FactoryTest, GivesUpAWorkerThatRunsAndDoesNotRegister) {
  submit("1");
  run(0);
  (void)look();
  now_ += minutes(5);
  EXPECT_THAT(look().cancelled, IsEmpty());
  now_ += seconds(1);
  EXPECT_THAT(look().cancelled, ElementsAre("1"));
  EXPECT_THAT(events_, ElementsAre("worker_start_failed allocation=1 "
                                   "reason=\"its worker did not register within 5 minutes\""));
}

TEST_F(FactoryTest, PausesWhenThreeWorkersInARowDoNotStart) {
  for (int i = 1; i <= 3; ++i) {
    EXPECT_EQ(reason_to_pause(state_), std::nullopt);
    submit(std::to_string(i));
    (void)look();
    view_.allocations.clear();
    now_ += seconds(30);
    (void)look();  // A queue may leave something out for once.
    now_ += minutes(1);
    (void)look();
  }
  ASSERT_TRUE(reason_to_pause(state_));
  EXPECT_EQ(*reason_to_pause(state_),
            "3 workers in a row did not start; allocation 3: it ended before its worker "
            "registered");
}

TEST_F(FactoryTest, ForgetsFailedStartsWhenAWorkerRegisters) {
  state_.num_failed_starts = 2;
  submit("1");
  run(0);
  enter("1");
  (void)look();
  EXPECT_EQ(state_.num_failed_starts, 0);
  // It ends later, as workers do.
  view_.allocations.clear();
  view_.workers.clear();
  now_ += minutes(2);
  (void)look();
  EXPECT_EQ(state_.num_failed_starts, 0);
}

TEST_F(FactoryTest, WaitsLongerAfterEachFailedSubmissionAndPausesAfterTen) {
  const std::vector<int> waits_min{1, 15, 30, 60, 60, 60, 60, 60, 60, 60};
  for (std::size_t i = 0; i < waits_min.size(); ++i) {
    EXPECT_EQ(reason_to_pause(state_), std::nullopt);
    EXPECT_EQ(look().num_submissions, 1u) << i;
    fail_submission();
    now_ += minutes(waits_min[i]) - seconds(1);
    EXPECT_EQ(look().num_submissions, 0u) << i;
    now_ += seconds(1);
  }
  ASSERT_TRUE(reason_to_pause(state_));
  EXPECT_EQ(*reason_to_pause(state_),
            "10 submissions failed in a row; submission: sbatch: no such partition");
  EXPECT_EQ(look().num_submissions, 0u);
}

TEST_F(FactoryTest, ForgetsFailedSubmissionsWhenOneIsTaken) {
  fail_submission();
  on_submitted(state_, "1", now_);
  EXPECT_EQ(state_.num_failed_submissions, 0);
}

TEST_F(FactoryTest, StaysPausedThoughAWorkerRegistersLate) {
  submit("1");
  state_.num_failed_starts = 3;
  run(0);
  enter("1");
  view_.num_open_runs = 1'000'000;
  view_.rate_hz = 1e-3;
  EXPECT_EQ(look().num_submissions, 0u);
  EXPECT_TRUE(reason_to_pause(state_));
}

TEST_F(FactoryTest, CancelsWhatWaitsAlsoWhenItIsPaused) {
  submit("1");
  state_.num_failed_starts = 3;
  view_.num_open_runs = 0;
  EXPECT_THAT(look().cancelled, ElementsAre("1"));
}

TEST_F(FactoryTest, ReportsHowManyWorkersItWantsAndHas) {
  config_.backlog = 2;
  config_.workers_max = 3;
  state_.rate_per_worker_hz = 1e-3;
  submit("1");
  submit("2");
  run(0);
  enter("1");
  view_.workers.insert("stranger");
  (void)look();
  const proto::FactoryReport report = report_of(state_, config_, view_, now_);
  EXPECT_EQ(report.name(), "proofmass");
  EXPECT_EQ(report.phase(), proto::FACTORY_PHASE_ACTIVE);
  EXPECT_EQ(report.num_wanted(), 3u);
  EXPECT_EQ(report.num_registered(), 1u);
  EXPECT_EQ(report.num_queued(), 1u);
  EXPECT_EQ(report.reason(), "");
}

TEST_F(FactoryTest, ReportsWhyAndHowLongItWaits) {
  fail_submission();
  now_ += seconds(20);
  const proto::FactoryReport report = report_of(state_, config_, view_, now_);
  EXPECT_EQ(report.phase(), proto::FACTORY_PHASE_WAITING);
  EXPECT_EQ(report.wait_s(), 40.0);
  EXPECT_EQ(report.reason(), "submission: sbatch: no such partition");
  now_ += seconds(40);
  EXPECT_EQ(report_of(state_, config_, view_, now_).phase(), proto::FACTORY_PHASE_ACTIVE);
}

TEST_F(FactoryTest, ReportsWhyItIsPaused) {
  for (int i = 0; i < 10; ++i) fail_submission();
  const proto::FactoryReport report = report_of(state_, config_, view_, now_);
  EXPECT_EQ(report.phase(), proto::FACTORY_PHASE_PAUSED);
  EXPECT_EQ(report.wait_s(), 0.0);
  EXPECT_EQ(report.reason(), *reason_to_pause(state_));
}

}  // namespace
}  // namespace proofmass::coordinator
