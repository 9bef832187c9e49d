#include "core/error.hpp"
#include "core/model.hpp"
#include "tests/test.hpp"
#include "tests/worker/execution/executor_bench.hpp"

namespace proofmass::worker {
namespace {

TEST(Executor, ComputesTheRunsOfItsLeasesInOrder) {
  Bench bench(prepare_counting(2));
  submit(bench.executor, lease(10, 3));
  submit(bench.executor, lease(40, 1));
  const std::vector<wire::LeasedResult> runs = bench.wait_for(4);
  EXPECT_EQ(indices_of(runs), (Indices{10, 11, 12, 40}));
  for (const wire::LeasedResult& run : runs) {
    EXPECT_EQ(run.campaign, first_campaign);
    EXPECT_EQ(run.computed.result.num_draws, run.computed.result.run.value);
    EXPECT_GE(run.computed.elapsed_s, 0.0);
  }
  EXPECT_EQ(bench.executor.num_steps_done(), 8U);
  EXPECT_TRUE(bench.executor.computing().empty());
}

// The first batch holds the thread while the leases come.
TEST(Executor, FillsABatchWithRunsOfSeveralLeases) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 4});
  submit(bench.executor, lease(0, 1));
  gate.entered.acquire();
  submit(bench.executor, lease(10, 3));
  submit(bench.executor, lease(20, 3));
  gate.open.release(3);
  const std::vector<wire::LeasedResult> runs = bench.wait_for(7);
  EXPECT_EQ(indices_of(runs), (Indices{0, 10, 11, 12, 20, 21, 22}));
  const Indices size_of_its_batch{1, 4, 4, 4, 4, 2, 2};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].computed.result.num_rounds, size_of_its_batch[i]);
  }
}

// Another model may have larger batches.
TEST(Executor, TakesNoMoreRunsThanTheirModelComputesTogether) {
  const std::uint64_t batch_size = model().batch_size();
  Bench bench(prepare_counting(1), {.num_threads = 1, .batch_size_max = 4 * batch_size});
  submit(bench.executor, lease(0, 2 * batch_size));
  for (const wire::LeasedResult& run : bench.wait_for(2 * batch_size)) {
    EXPECT_EQ(run.computed.result.num_rounds, batch_size);
  }
}

TEST(Executor, GivesEachRunTheTimeOfItsBatchAndAShareOfIt) {
  Bench bench(prepare_counting(1), {.num_threads = 1, .batch_size_max = 4});
  EXPECT_FALSE(bench.executor.usual_batch_time().has_value());
  submit(bench.executor, lease(0, 4));
  const std::vector<wire::LeasedResult> runs = bench.wait_for(4);
  for (const wire::LeasedResult& run : runs) {
    EXPECT_EQ(run.computed.elapsed_s, runs[0].computed.elapsed_s);
    EXPECT_EQ(run.computed.compute_s, run.computed.elapsed_s / 4.0);
  }
  EXPECT_EQ(std::chrono::duration<double>(*bench.executor.usual_batch_time()).count(),
            runs[0].computed.elapsed_s);
}

// Smaller ones take less time, and say nothing of how long the next full one will take.
TEST(Executor, KnowsTheTimeOfTheLastBatchAmongTheLargest) {
  Bench bench(prepare_counting(1), {.num_threads = 1, .batch_size_max = 4});
  const auto usual_s = [&] {
    return std::chrono::duration<double>(*bench.executor.usual_batch_time()).count();
  };
  submit(bench.executor, lease(0, 1));
  const double single_s = bench.wait_for(1)[0].computed.elapsed_s;
  EXPECT_EQ(single_s, usual_s());
  submit(bench.executor, lease(10, 4));
  const double full_s = bench.wait_for(4)[0].computed.elapsed_s;
  EXPECT_EQ(full_s, usual_s());
  submit(bench.executor, lease(20, 2));
  (void)bench.wait_for(2);
  EXPECT_EQ(full_s, usual_s());
}

// Both threads are inside a batch at the same time, or the second entry never comes.
TEST(Executor, ComputesABatchOnEachThread) {
  Gate gate;
  std::atomic<int> num_prepared = 0;
  const auto prepare = [&](const Campaign& of) {
    ++num_prepared;
    return gate.prepare()(of);
  };
  Bench bench(prepare, {.num_threads = 2, .batch_size_max = 2});
  submit(bench.executor, lease(0, 3));
  submit(bench.executor, lease(3, 2));
  gate.entered.acquire();
  gate.entered.acquire();
  gate.open.release(3);
  Indices indices = indices_of(bench.wait_for(5));
  std::sort(indices.begin(), indices.end());
  EXPECT_EQ(indices, (Indices{0, 1, 2, 3, 4}));
  EXPECT_EQ(num_prepared, 1) << "once for both threads";
}

TEST(Executor, TellsWhatIsBeingComputedAndHowFarItIs) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 4});
  submit(bench.executor, lease(20, 2));
  gate.entered.acquire();
  submit(bench.executor, lease(3, 1));
  const std::vector<RunningBatch> running = bench.executor.computing();
  ASSERT_EQ(running.size(), 1U) << "what waits is not being computed";
  EXPECT_EQ(running[0].campaign, first_campaign);
  EXPECT_EQ(running[0].ranges, (std::vector<RunRange>{{{20}, 2}}));
  EXPECT_EQ(running[0].num_steps_done, 1U);
  ASSERT_TRUE(running[0].time_left.has_value());
  EXPECT_GT(*running[0].time_left, Duration::zero());
  gate.open.release(2);
  (void)bench.wait_for(3);
}

// One step of ten is done: what is left takes nine times as long as it has taken so far.
TEST(Executor, ExpectsTheStepsToComeToTakeAsLongAsThoseThatAreDone) {
  Gate gate;
  Bench bench(gate.prepare());
  const TimePoint before = std::chrono::steady_clock::now();
  submit(bench.executor, lease(0, 1));
  gate.entered.acquire();
  const Duration left = bench.executor.computing().at(0).time_left.value();
  EXPECT_LE(left, 9 * (std::chrono::steady_clock::now() - before));
  const Duration left_later = bench.executor.computing().at(0).time_left.value();
  EXPECT_GE(left_later, left) << "no step was done since";
  gate.open.release();
  (void)bench.wait_for(1);
}

TEST(Executor, ComputesARunThatIsToBeAloneInABatchOfItsOwn) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 4});
  submit(bench.executor, lease(0, 1));
  gate.entered.acquire();
  proto::RunLease suspect = lease(5, 1);
  suspect.set_is_alone(true);
  submit(bench.executor, lease(1, 1));
  submit(bench.executor, suspect);
  submit(bench.executor, lease(2, 1));
  gate.open.release(3);
  const std::vector<wire::LeasedResult> runs = bench.wait_for(4);
  EXPECT_EQ(indices_of(runs), (Indices{0, 1, 2, 5}));
  const Indices size_of_its_batch{1, 2, 2, 1};
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].computed.result.num_rounds, size_of_its_batch[i]);
  }
}

TEST(Executor, DropsOnlyWhatWaits) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 2});
  submit(bench.executor, lease(0, 5));
  gate.entered.acquire();
  const std::array wanted{RunRange{{1}, 3}};
  EXPECT_EQ(bench.executor.drop_waiting(first_campaign, wanted), (std::vector<RunIndex>{{2}, {3}}));
  EXPECT_TRUE(bench.executor.drop_waiting(second_campaign, wanted).empty());
  gate.open.release(2);
  EXPECT_EQ(indices_of(bench.wait_for(3)), (Indices{0, 1, 4}));
}

TEST(Executor, DropsABatchOnceAndComputesTheRunsAgainIfTheyComeAgain) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 2});
  submit(bench.executor, lease(0, 2));
  gate.entered.acquire();
  const std::uint64_t number = bench.executor.computing().at(0).number;
  EXPECT_TRUE(bench.executor.drop_batch(number));
  EXPECT_FALSE(bench.executor.drop_batch(number));
  EXPECT_TRUE(bench.executor.computing().empty());
  submit(bench.executor, lease(1, 1));
  gate.open.release(2);
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{1});
  EXPECT_TRUE(bench.executor.take_finished().empty());
}

TEST(Executor, GoesOnAfterACrashOutside) {
  Bench bench([](const Campaign&) -> PreparedCampaign {
    return {.simulate = [](std::span<const RunRequest> requests, const auto&) {
      if (requests.front().run == RunIndex{0}) throw SimulationCrash("it is gone");
      if (requests.front().run == RunIndex{2}) throw ConfigError("x", "1", "must be 0");
      return results_of(requests);
    }};
  });
  submit(bench.executor, lease(0, 3));
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{1});
  std::vector<CrashedBatch> crashed;
  while (crashed.size() < 2) {
    std::ranges::move(bench.executor.take_crashed(), std::back_inserter(crashed));
  }
  EXPECT_EQ(crashed[0].campaign, first_campaign);
  EXPECT_EQ(crashed[0].runs, std::vector<RunIndex>{{0}});
  EXPECT_EQ(crashed[0].reason, "it is gone");
  EXPECT_EQ(crashed[1].reason, "x = 1 (must be 0)");
  EXPECT_TRUE(bench.executor.computing().empty());
  EXPECT_FALSE(bench.executor.failure().has_value());
}

// The batch does not look any more whether it is wanted.
TEST(Executor, DropsABatchThatIsJustFinishing) {
  std::counting_semaphore<> entered{0};
  std::counting_semaphore<> open{0};
  const Prepare prepare = [&](const Campaign&) -> PreparedCampaign {
    return {.simulate = [&](std::span<const RunRequest> requests, const std::function<void(int)>&) {
      entered.release();
      open.acquire();
      return results_of(requests);
    }};
  };
  Bench bench(prepare);
  submit(bench.executor, lease(0, 1));
  submit(bench.executor, lease(1, 1));
  entered.acquire();
  EXPECT_TRUE(bench.executor.drop_batch(bench.executor.computing().at(0).number));
  open.release(2);
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{1});
}

TEST(Executor, DropsTheRunsAtHandWhenItAbandons) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 2, .batch_size_max = 2});
  submit(bench.executor, lease(0, 5));
  gate.entered.acquire();
  gate.entered.acquire();
  bench.executor.abandon();
  gate.open.release(2);

  submit(bench.executor, lease(5, 1));
  gate.entered.acquire();
  gate.open.release();
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{5});
}

/// Runs that never end; they look whether they are wanted.
Prepare prepare_endless(std::counting_semaphore<>& entered) {
  return [&entered](const Campaign&) -> PreparedCampaign {
    return {
        .simulate = [&entered](std::span<const RunRequest>,
                               const std::function<void(int)>& progress) -> std::vector<RunResult> {
          entered.release();
          while (true) progress(1);
        },
        .num_steps = 1};
  };
}

TEST(Executor, EndsInTheMiddleOfRuns) {
  std::counting_semaphore<> entered{0};
  {
    Bench bench(prepare_endless(entered), {.num_threads = 2, .batch_size_max = 3});
    submit(bench.executor, lease(0, 1000));
    entered.acquire();
    entered.acquire();
  }
  SUCCEED();
}

// The first campaign computes, and the second one is being prepared, which nobody waits for.
TEST(Executor, EndsInTimeUnlessAThreadHangs) {
  Gate gate;
  std::counting_semaphore<> preparing{0};
  std::counting_semaphore<> may_prepare{1};
  const Prepare prepare = [&](const Campaign& campaign) {
    preparing.release();
    may_prepare.acquire();
    return gate.prepare()(campaign);
  };
  Bench bench(prepare, {.num_threads = 2});
  submit(bench.executor, lease(0, 1));
  gate.entered.acquire();
  preparing.acquire();
  bench.executor.define(second_campaign, definition());
  submit(bench.executor, lease(0, 1, second_campaign));
  preparing.acquire();
  EXPECT_FALSE(bench.executor.end_within(std::chrono::milliseconds(1)));
  gate.open.release();
  EXPECT_TRUE(bench.executor.end_within(std::chrono::minutes(1)));
  EXPECT_TRUE(bench.executor.is_preparing());
  EXPECT_TRUE(bench.executor.take_finished().empty());
  may_prepare.release();
}

/// Yields the campaign's seed as number of draws.
Prepare prepare_by_seed(std::atomic<int>& num_prepared) {
  return [&num_prepared](const Campaign& campaign) -> PreparedCampaign {
    ++num_prepared;
    return {.simulate =
                [seed = campaign.seed](std::span<const RunRequest> requests,
                                       const std::function<void(int)>&) {
                  std::vector<RunResult> results = results_of(requests);
                  for (RunResult& result : results) {
                    result.num_draws = static_cast<std::uint32_t>(seed);
                  }
                  return results;
                },
            .num_steps = 1};
  };
}

std::shared_ptr<const Campaign> definition_with(std::uint64_t seed) {
  MicroscopeCampaign campaign;
  campaign.seed = seed;
  return std::make_shared<const MicroscopeCampaign>(campaign);
}

TEST(Executor, LetsRunsOfACampaignWaitUntilItIsDefined) {
  std::atomic<int> num_prepared = 0;
  Bench bench(prepare_by_seed(num_prepared));
  EXPECT_TRUE(bench.executor.is_defined(first_campaign));
  EXPECT_FALSE(bench.executor.is_defined(second_campaign));
  submit(bench.executor, lease(4, 1, second_campaign));
  submit(bench.executor, lease(5, 1));
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{5});
  bench.executor.define(second_campaign, definition_with(7));
  EXPECT_EQ(bench.wait_for(1)[0].computed.result.num_draws, 7U);
}

TEST(Executor, KeepsTheCampaignsThatWereUsedLast) {
  std::atomic<int> num_prepared = 0;
  Bench bench(prepare_by_seed(num_prepared),
              {.num_threads = 1, .batch_size_max = 1, .num_campaigns_max = 2});
  bench.executor.define(second_campaign, definition_with(2));
  submit(bench.executor, lease(0, 1, second_campaign));
  (void)bench.wait_for(1);
  submit(bench.executor, lease(0, 1));
  (void)bench.wait_for(1);
  bench.executor.define({3}, definition_with(3));
  EXPECT_TRUE(bench.executor.is_defined(first_campaign));
  EXPECT_FALSE(bench.executor.is_defined(second_campaign));
}

// A campaign that is at work and one that has runs waiting stay, and the third has room as well.
TEST(Executor, KeepsCampaignsThatHaveRuns) {
  Gate gate;
  Bench bench(gate.prepare(), {.num_threads = 1, .batch_size_max = 1, .num_campaigns_max = 1});
  submit(bench.executor, lease(0, 1));
  gate.entered.acquire();
  bench.executor.define(second_campaign, definition());
  submit(bench.executor, lease(0, 1, second_campaign));
  bench.executor.define({3}, definition());
  EXPECT_TRUE(bench.executor.is_defined(first_campaign));
  EXPECT_TRUE(bench.executor.is_defined(second_campaign));
  EXPECT_TRUE(bench.executor.is_defined({3}));
  gate.open.release(2);
  (void)bench.wait_for(2);
}

TEST(Executor, ForgetsACampaignWithItsRunsAndResults) {
  Gate gate;
  Bench bench(gate.prepare());
  submit(bench.executor, lease(0, 3));
  gate.entered.acquire();
  gate.open.release();
  gate.entered.acquire();  // Of the second run: the result of the first is there.
  bench.executor.forget(first_campaign);
  EXPECT_FALSE(bench.executor.is_defined(first_campaign));
  EXPECT_TRUE(bench.executor.computing().empty());
  EXPECT_TRUE(bench.executor.take_finished().empty());
  gate.open.release();

  bench.executor.define(second_campaign, definition());
  submit(bench.executor, lease(9, 1, second_campaign));
  gate.open.release();
  bench.wait_for_change();
  EXPECT_EQ(indices_of(bench.wait_for(1)), Indices{9});
}

// What was prepared from the first definition is never used.
TEST(Executor, PreparesACampaignThatIsDefinedAgainWhileItIsPrepared) {
  std::binary_semaphore is_preparing{0};
  std::binary_semaphore go_on{0};
  std::atomic<int> num_prepared = 0;
  const Prepare prepare = [&](const Campaign& campaign) {
    if (campaign.seed == 1) {
      is_preparing.release();
      go_on.acquire();
    }
    return prepare_by_seed(num_prepared)(campaign);
  };
  Bench bench(prepare, {.num_threads = 1, .batch_size_max = 2});
  submit(bench.executor, lease(0, 1));
  is_preparing.acquire();
  bench.executor.forget(first_campaign);
  bench.executor.define(first_campaign, definition_with(2));
  submit(bench.executor, lease(1, 2));
  go_on.release();
  for (const wire::LeasedResult& run : bench.wait_for(2))
    EXPECT_EQ(run.computed.result.num_draws, 2U);
}

TEST(Executor, SaysWhyItCannotGoOn) {
  Bench bench(
      [](const Campaign&) -> PreparedCampaign { throw std::runtime_error("out of memory"); },
      {.num_threads = 3, .batch_size_max = 1});
  EXPECT_FALSE(bench.executor.failure().has_value());
  submit(bench.executor, lease(0, 1));
  bench.wait_for_change();
  EXPECT_EQ(bench.executor.failure(), "out of memory");
}

}  // namespace
}  // namespace proofmass::worker
