#include "coordinator/page/page_views.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

RecentAttempt computed(std::uint64_t run, std::uint64_t worker, double compute_s,
                       std::uint64_t received) {
  return {.worker_key = worker,
          .worker = worker == 1 ? "a" : "b",
          .first = {run},
          .last = {run},
          .attempt = {1},
          .compute_s = compute_s,
          .unix_s = received};
}

/// Of two workers, with up to three threads each.
RecentAttempts random_attempts(unsigned seed, double compute_s_max) {
  std::mt19937 random(seed);
  RecentAttempts attempts;
  std::uint64_t received = 2'000'000'000;
  for (std::uint64_t run = 0; run < 200; ++run) {
    received -= random() % 2;
    const double compute_s = compute_s_max * static_cast<double>(random() % 1000 + 1) / 1000.0;
    attempts.computed.push_back(computed(run, random() % 2 + 1, compute_s, received));
  }
  return attempts;
}

TEST(AttemptLanes, HoldEachAttemptOnceWithoutOverlap) {
  constexpr double last_s = 2e9;
  for (const double compute_s_max : {0.05, 3.0, 40.0}) {
    const RecentAttempts attempts = random_attempts(1, compute_s_max);
    std::set<std::size_t> runs;
    std::string worker;
    for (const TimelineLane& lane : lanes_of(attempts, last_s)) {
      if (!lane.label.empty()) worker = lane.label;
      double free_until = 1e300;
      for (const TimelineBar& bar : lane.bars) {
        const std::size_t run = std::stoul(bar.tooltip.substr(std::string("run ").size()));
        EXPECT_TRUE(runs.insert(run).second) << run;
        EXPECT_EQ(attempts.computed.at(run).worker_key, worker == "a" ? 1U : 2U);
        EXPECT_LE(bar.end, free_until);
        free_until = bar.begin;
        const double received = static_cast<double>(attempts.computed[run].unix_s) - last_s;
        EXPECT_LE(bar.end, received);
        EXPECT_GE(bar.end, received - 1.0);
      }
    }
    EXPECT_EQ(runs.size(), attempts.computed.size());
  }
}

// One thread computes one batch after the other, and its results come in whole seconds.
TEST(AttemptLanes, AreOneForOneThread) {
  RecentAttempts attempts;
  for (int i = 50; i > 0; --i) {
    attempts.computed.push_back(computed(static_cast<std::uint64_t>(i), 1, 1.5,
                                         static_cast<std::uint64_t>(1000.0 + 1.5 * i)));
  }
  EXPECT_EQ(lanes_of(attempts, 0.0).size(), 1U);
}

TEST(AttemptsChart, SaysHowManyLanesItLeavesOut) {
  RecentAttempts attempts;
  for (std::uint64_t worker = 1; worker <= 30; ++worker) {
    attempts.computed.push_back(computed(worker, worker, 1.0, 1000));
  }
  EXPECT_THAT(attempts_chart(attempts), HasSubstr("showing 24 of 30 lanes"));
  EXPECT_THAT(attempts_chart({}), HasSubstr("none yet"));
}

}  // namespace
}  // namespace proofmass::coordinator
