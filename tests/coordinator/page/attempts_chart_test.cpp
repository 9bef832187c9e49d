#include "coordinator/page/attempts_chart.hpp"

#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

ComputedRuns computed(std::uint64_t run, std::uint64_t worker, double compute_s,
                      std::uint64_t received) {
  return {.runs = {{run}},
          .attempt = {1},
          .worker_key = worker,
          .compute_s = compute_s,
          .received_unix_s = received};
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
  attempts.workers = {{.key = 1, .name = "a", .host = "h"}, {.key = 2, .name = "b", .host = "h"}};
  return attempts;
}

TEST(AttemptLanes, HoldEachAttemptOnceWithoutOverlap) {
  for (const double compute_s_max : {0.05, 3.0, 40.0}) {
    const RecentAttempts attempts = random_attempts(1, compute_s_max);
    std::size_t count = 0;
    for (const AttemptLane& lane : lanes_of(attempts)) {
      double free_until = 1e300;
      for (const PlacedAttempt& attempt : lane.attempts) {
        EXPECT_EQ(attempt.computed->worker_key, lane.worker_key);
        EXPECT_LE(attempt.end_s, free_until);
        free_until = attempt.begin_s();
        const auto received = static_cast<double>(attempt.computed->received_unix_s);
        EXPECT_LE(attempt.end_s, received);
        EXPECT_GE(attempt.end_s, received - 1.0);
        ++count;
      }
    }
    EXPECT_EQ(count, attempts.computed.size());
  }
}

// One thread computes one batch after the other, and its results come in whole seconds.
TEST(AttemptLanes, AreOneForOneThread) {
  RecentAttempts attempts;
  for (int i = 50; i > 0; --i) {
    attempts.computed.push_back(computed(static_cast<std::uint64_t>(i), 1, 1.5,
                                         static_cast<std::uint64_t>(1000.0 + 1.5 * i)));
  }
  EXPECT_EQ(lanes_of(attempts).size(), 1U);
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
