// Whether batches are full, and when the last one ends: workers that compute batches, in a time of
// their own.

#include <deque>
#include <ostream>

#include "coordinator/dispatch/events.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/runs.hpp"
#include "tests/coordinator/dispatch/invariants.hpp"
#include "tests/support/messages.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// A run that a worker holds.
struct HeldRun {
  wire::Attempt attempt;
  RunIndex run;
  std::uint32_t batch_runs_max = 0;
};

/// How long a batch of so many runs takes.
using BatchTime = std::function<double(std::size_t num_runs)>;

/// What a thread of a worker computes.
struct PlayedBatch {
  std::vector<HeldRun> runs;  ///< Empty: the thread is idle.
  double begins = 0.0;
  double ends = 0.0;
};

/// How fast a card is: an H100 as it was measured.
struct CardSpeed {
  std::size_t num_slots = 16'896;
  double runs_per_s = 2'050.0;
  double latency_s = 3.2;  ///< Of its longest session.
};

/// A card: groups of runs flow through it, the first first.
struct PlayedCard {
  CardSpeed speed;
  std::deque<HeldRun> queue{};
  std::deque<PlayedBatch> groups{};
  std::size_t num_in_flight = 0;
  double busy_until = 0.0;

  void take_groups(double now) {
    constexpr std::size_t group_size = 128;
    while (!queue.empty() && num_in_flight + group_size <= speed.num_slots) {
      const std::size_t count = std::min(queue.size(), group_size);
      const auto end = queue.begin() + static_cast<std::ptrdiff_t>(count);
      busy_until = std::max(busy_until, now) + static_cast<double>(count) / speed.runs_per_s;
      groups.push_back({.runs = {queue.begin(), end},
                        .begins = now,
                        .ends = std::max(now + speed.latency_s, busy_until)});
      queue.erase(queue.begin(), end);
      num_in_flight += count;
    }
  }
};

/// A worker: each of its threads takes what is there, up to a batch.
struct PlayedWorker {
  std::deque<HeldRun> queue;
  std::vector<PlayedBatch> threads;
  std::optional<PlayedCard> card = std::nullopt;

  [[nodiscard]] std::size_t next_size() const {
    const std::size_t wanted = queue.front().batch_runs_max;
    return std::min({queue.size(), batch_lanes, wanted > 0 ? wanted : batch_lanes});
  }

  void take_batches(double now, const BatchTime& batch_time) {
    if (card) card->take_groups(now);
    for (PlayedBatch& batch : threads) {
      if (!batch.runs.empty() || queue.empty()) continue;
      const std::size_t count = next_size();
      const auto end = queue.begin() + static_cast<std::ptrdiff_t>(count);
      batch.runs.assign(queue.begin(), end);
      queue.erase(queue.begin(), end);
      batch.begins = now;
      batch.ends = now + batch_time(count);
    }
  }
};

/// What the coordinator knows of the workers when a campaign begins.
enum class Workers {
  unknown,     ///< They register one after another.
  expected,    ///< The same, but it is known how many slots there will be.
  registered,  ///< All are there.
};

/// What is played.
struct Plan {
  std::uint64_t num_runs = 1;
  std::size_t num_workers = 1;
  std::size_t num_threads = 1;  ///< Of each worker.
  Workers workers = Workers::unknown;
  std::size_t num_cards = 0;  ///< Of the first workers, one each.
  CardSpeed card{};
};

std::ostream& operator<<(std::ostream& out, const Plan& plan) {
  constexpr std::array names{"unknown", "expected", "registered"};
  return out << plan.num_runs << " runs, " << plan.num_workers << ' '
             << names[static_cast<std::size_t>(plan.workers)] << " workers of " << plan.num_threads
             << " threads, " << plan.num_cards << " cards of " << plan.card.runs_per_s << " runs/s";
}

/// A campaign whose store commits at once and whose messages arrive at once.
class PlayedFleet final : public Outbox {
 public:
  explicit PlayedFleet(const Plan& plan, std::vector<RunRange> finished = {}) {
    const std::uint64_t num_slots = plan.num_threads * batch_lanes;
    DispatchConfig config;
    if (plan.workers == Workers::expected) config.num_slots_expected = plan.num_workers * num_slots;
    state_ = initial_state(config, {}, {});
    if (plan.workers != Workers::registered) begin_campaign(plan.num_runs, std::move(finished));
    for (std::uint64_t i = 1; i <= plan.num_workers; ++i) {
      PlayedWorker& worker = workers_[WorkerId{i}];
      worker.threads.resize(plan.num_threads);
      if (i <= plan.num_cards) worker.card = PlayedCard{.speed = plan.card};
      const auto num_card_slots = static_cast<std::uint32_t>(worker.card ? plan.card.num_slots : 0);
      const auto num_slots_in_all = static_cast<std::uint32_t>(num_slots) + num_card_slots;
      auto hello = test::make_hello("w", "h", num_slots_in_all, model_version);
      hello.set_num_card_slots(num_card_slots);
      on_hello(state_, WorkerId{i}, SessionId{i}, {}, hello, {}, *this);
      const std::uint32_t credit = std::max(2 * num_slots_in_all, wire::runs_per_lease_max);
      on_heartbeat(state_, WorkerId{i}, test::make_heartbeat(credit), 1, {}, *this);
    }
    if (plan.workers == Workers::registered) begin_campaign(plan.num_runs, std::move(finished));
  }

  /// Time until the campaign is finished.
  double play(const BatchTime& batch_time) {
    double now = 0.0;
    while (!is_finished(state_.campaigns.at(id_))) {
      for (auto& [id, worker] : workers_) worker.take_batches(now, batch_time);
      now = next_end();
      for (auto& [id, worker] : workers_) {
        for (PlayedBatch& batch : worker.threads) {
          if (batch.runs.empty() || batch.begins >= now || batch.ends > now) continue;
          deliver(id, std::exchange(batch, {}), batch_time);
        }
        if (worker.card) deliver_groups(id, *worker.card, now, batch_time);
      }
      check_invariants(state_);
    }
    return now;
  }

  /// Batches that begin before this time although they are not full.
  [[nodiscard]] std::ptrdiff_t num_partial_batches_before(double time) const {
    return std::ranges::count_if(partial_batches_begin_,
                                 [&](double begins) { return begins < time; });
  }

  void send(WorkerId id, proto::Envelope message) override {
    const proto::RunLease& lease = message.run_lease();  // Without runs if it is none.
    for (const RunIndex run : indices_of(std::array{wire::runs_of(lease)})) {
      PlayedWorker& worker = workers_.at(id);
      (lease.is_for_cards() ? worker.card->queue : worker.queue)
          .push_back(
              {.attempt = {lease.attempt()}, .run = run, .batch_runs_max = lease.batch_runs_max()});
    }
  }
  void send_definition(WorkerId, CampaignId, std::uint64_t,
                       const std::shared_ptr<const Campaign>&) override {}
  void write(CampaignId, Entry entry) override {
    if (const auto* const delivery = std::get_if<Delivery>(&entry)) {
      stored_.push_back(delivery->result.run);
    } else {
      EXPECT_TRUE(std::holds_alternative<WorkerJoined>(entry)) << "computed twice, or lost";
    }
  }
  void log(Event, CampaignId) override {}

 private:
  void begin_campaign(std::uint64_t num_runs, std::vector<RunRange> finished) {
    MicroscopeCampaign campaign;
    campaign.num_runs = num_runs;
    on_campaign(state_, id_,
                {.definition = std::make_shared<const MicroscopeCampaign>(campaign),
                 .finished = std::move(finished)},
                {}, *this);
  }

  [[nodiscard]] double next_end() const {
    double next = std::numeric_limits<double>::infinity();
    for (const auto& [id, worker] : workers_) {
      for (const PlayedBatch& batch : worker.threads) {
        if (!batch.runs.empty()) next = std::min(next, batch.ends);
      }
      if (!worker.card) continue;
      if (!worker.card->groups.empty()) next = std::min(next, worker.card->groups.front().ends);
    }
    return next;
  }

  void deliver_groups(WorkerId id, PlayedCard& card, double now, const BatchTime& batch_time) {
    while (!card.groups.empty() && card.groups.front().ends <= now) {
      const PlayedBatch group = std::move(card.groups.front());
      card.groups.pop_front();
      card.num_in_flight -= group.runs.size();
      deliver(id, group, batch_time, true);
    }
  }

  /// One message an attempt, as workers send them. The thread is free before its results arrive: it
  /// finds what was lent before.
  void deliver(WorkerId id, const PlayedBatch& batch, const BatchTime& batch_time,
               bool is_by_card = false) {
    if (batch.runs.size() < batch_lanes) partial_batches_begin_.push_back(batch.begins);
    std::map<wire::Attempt, std::vector<wire::ComputedRun>> messages;
    for (const HeldRun& held : batch.runs) {
      wire::ComputedRun computed;
      computed.result = test::zero_result({.run = held.run, .num_draws = 1});
      computed.elapsed_s = batch.ends - batch.begins;
      computed.is_by_card = is_by_card;
      messages[held.attempt].push_back(computed);
    }
    workers_.at(id).take_batches(batch.ends, batch_time);
    const TimePoint now = TimePoint{} + std::chrono::duration_cast<Duration>(
                                            std::chrono::duration<double>(batch.ends));
    for (const auto& [attempt, results] : messages) {
      on_results(state_, id, id_, attempt, results, now, *this);
      on_committed(state_, id_, std::exchange(stored_, {}), now, *this);
    }
  }

  const CampaignId id_{1};
  State state_;
  std::map<WorkerId, PlayedWorker> workers_;
  std::vector<RunIndex> stored_;
  std::vector<double> partial_batches_begin_;
};

TEST(BatchRounds, AreAsFewAsTheyCanBe) {
  for (const std::uint64_t num_runs : {1U, 16U, 17U, 100U, 300U, 1000U, 5000U}) {
    for (const std::size_t num_workers : {1U, 2U, 3U, 8U}) {
      for (const std::size_t num_threads : {1U, 2U, 7U}) {
        for (const double batch_time_s : {0.1, 2.4, 60.0}) {
          const Plan plan{num_runs, num_workers, num_threads};
          const std::uint64_t num_batches = (num_runs + batch_lanes - 1) / batch_lanes;
          const std::size_t num_at_a_time = num_workers * num_threads;
          const auto fewest = static_cast<int>((num_batches + num_at_a_time - 1) / num_at_a_time);
          PlayedFleet fleet(plan);
          const double time_s = fleet.play([&](std::size_t) { return batch_time_s; });
          EXPECT_EQ(std::lround(time_s / batch_time_s), fewest)
              << plan << ", " << batch_time_s << " s a batch";
          EXPECT_EQ(fleet.num_partial_batches_before(time_s - 1.5 * batch_time_s), 0);
        }
      }
    }
  }
}

// Every tenth run is there already, so that no lease holds more than nine. Batches are full until
// nothing waits any more, two rounds before the end.
TEST(BatchRounds, AreAsFewAndOneIfLeasesAreSmallerThanBatches) {
  std::vector<RunRange> finished;
  for (std::uint64_t run = 0; run < 1000; run += 10) finished.push_back({{run}, 1});
  PlayedFleet fleet({.num_runs = 1000, .num_workers = 2, .num_threads = 2}, finished);
  const double time_s = fleet.play([](std::size_t) { return 2.4; });
  EXPECT_LE(time_s, 2.4 * (15 + 1) + 1e-9);  // 900 runs are 56.25 batches, four at a time.
  EXPECT_LE(fleet.num_partial_batches_before(time_s), 2 * 4);
}

/// Times of batches as they were measured, in units of a full one.
double avx512_time(std::size_t num_runs) {
  if (num_runs <= 2) return num_runs == 1 ? 0.29 : 0.33;
  if (num_runs <= 4) return 0.50;
  return num_runs <= 8 ? 0.54 : 1.0;
}
double avx2_time(std::size_t num_runs) {
  if (num_runs <= 2) return num_runs == 1 ? 0.16 : 0.24;
  if (num_runs <= 4) return 0.31;
  return num_runs <= 8 ? 0.52 : 1.0;
}

/// What a campaign may take: 1.2 times what its work would take if it could be shared out at will,
/// and one batch of so few runs.
double time_max(const Plan& plan, const BatchTime& batch_time, std::size_t num_few = 1) {
  const double work = static_cast<double>(plan.num_runs) / batch_lanes;
  const auto num_threads = static_cast<double>(plan.num_workers * plan.num_threads);
  return 1.2 * (work / num_threads + batch_time(num_few));
}

TEST(BatchTimes, LeaveNoWorkerIdleForLong) {
  for (const auto workers : {Workers::expected, Workers::registered}) {
    for (const Plan& plan : {Plan{100, 16, 1}, Plan{1000, 64, 1}, Plan{1100, 64, 1},
                             Plan{100, 64, 1}, Plan{100, 2, 1}, Plan{1000, 2, 1}, Plan{100, 1, 16},
                             Plan{1000, 4, 16}, Plan{1000, 16, 4}, Plan{5000, 64, 1}}) {
      Plan played = plan;
      played.workers = workers;
      EXPECT_LE(PlayedFleet(played).play(avx512_time), time_max(played, avx512_time)) << played;
      EXPECT_LE(PlayedFleet(played).play(avx2_time), time_max(played, avx2_time)) << played;
    }
  }
}

// Parts of the time of a full batch, as coordinator/dispatch/README.md cites them.
TEST(BatchTimes, AreShorterThanOfFullBatchesIfThereAreFewRuns) {
  struct Row {
    Plan plan;
    double avx512;
    double avx2;
  };
  for (const Row& row : {Row{{100, 16, 1}, 0.54, 0.52}, Row{{100, 64, 1}, 0.33, 0.24},
                         Row{{1000, 64, 1}, 1.0, 1.0}, Row{{1100, 64, 1}, 1.33, 1.24}}) {
    Plan plan = row.plan;
    plan.workers = Workers::registered;
    EXPECT_DOUBLE_EQ(PlayedFleet(plan).play(avx512_time), row.avx512) << plan;
    EXPECT_DOUBLE_EQ(PlayedFleet(plan).play(avx2_time), row.avx2) << plan;
  }
}

// As soon as runs fill more than half of the slots, some thread is lent a full batch, which takes
// 1: with AVX2 a little more than the bound, 1.2 (0.5 + 0.31) = 0.97 at that point.
TEST(BatchTimes, LeaveNoWorkerIdleForLongWhateverTheNumberOfRuns) {
  constexpr std::size_t num_few = batch_lanes / 4;
  const auto bound = [](const Plan& plan, const BatchTime& batch_time) {
    const double time = time_max(plan, batch_time, num_few);
    const bool fills_half = 2 * plan.num_runs > plan.num_workers * plan.num_threads * batch_lanes;
    return fills_half ? std::max(1.0, time) : time;
  };
  for (const std::size_t num_workers : {1U, 3U, 16U}) {
    for (const std::size_t num_threads : {1U, 4U}) {
      const std::size_t step = (7 + num_workers * num_threads / 4) | 1U;  // All remainders of 16.
      for (std::uint64_t num_runs = 1; num_runs <= 50 * num_workers * num_threads;
           num_runs += step) {
        const Plan plan{num_runs, num_workers, num_threads, Workers::registered};
        EXPECT_LE(PlayedFleet(plan).play(avx512_time), bound(plan, avx512_time)) << plan;
        EXPECT_LE(PlayedFleet(plan).play(avx2_time), bound(plan, avx2_time)) << plan;
      }
    }
  }
}

// Then the first workers are lent full batches, as no others may come.
TEST(BatchTimes, LeaveSomeWorkersIdleIfItIsNotKnownThatTheyCome) {
  for (const Plan& plan : {Plan{100, 16, 1}, Plan{1000, 64, 1}, Plan{100, 2, 1}, Plan{1000, 2, 1},
                           Plan{1000, 16, 4}, Plan{5000, 64, 1}}) {
    EXPECT_LE(PlayedFleet(plan).play(avx512_time), time_max(plan, avx512_time, batch_lanes / 4))
        << plan;
  }
  EXPECT_EQ(PlayedFleet({100, 16, 1}).play(avx2_time), 1.0);
}

/// Seconds of a batch, as long as the speed of a card has them.
double batch_s(std::size_t num_runs) { return 2.4 * avx512_time(num_runs); }

/// Workers of 16 threads, with a card in the first ones: an H100, or one that is a third as fast.
std::vector<Plan> fleets_with_cards(std::uint64_t num_runs) {
  const CardSpeed slower{.num_slots = 13'824, .runs_per_s = 700.0, .latency_s = 9.0};
  constexpr auto registered = Workers::registered;
  return {{num_runs, 1, 15, registered, 1},
          {num_runs, 2, 16, registered, 1},
          {num_runs, 2, 16, registered, 2},
          {num_runs, 11, 16, registered, 1},
          {num_runs, 11, 16, registered, 1, slower}};
}

// The processors would take as long for what fills them as a card for its longest session.
TEST(BatchTimes, AreThoseWithoutCardsIfProcessorsHaveRoomForAllRuns) {
  for (const std::uint64_t num_runs : {1U, 16U, 50U, 100U, 200U, 240U}) {
    for (const Plan& plan : fleets_with_cards(num_runs)) {
      Plan without_cards = plan;
      without_cards.num_cards = 0;
      EXPECT_EQ(PlayedFleet(plan).play(batch_s), PlayedFleet(without_cards).play(batch_s)) << plan;
    }
  }
}

// A tenth more than the work at the speed of all together, and once the longest session.
TEST(BatchTimes, OfCardsAndProcessorsEndTogether) {
  for (const std::uint64_t num_runs : {300U, 1'000U, 3'000U, 10'000U, 20'000U, 50'000U}) {
    for (const Plan& plan : fleets_with_cards(num_runs)) {
      const auto num_threads = static_cast<double>(plan.num_workers * plan.num_threads);
      const double rate = num_threads * batch_lanes / batch_s(batch_lanes) +
                          static_cast<double>(plan.num_cards) * plan.card.runs_per_s;
      EXPECT_LE(PlayedFleet(plan).play(batch_s),
                1.1 * static_cast<double>(num_runs) / rate + plan.card.latency_s)
          << plan;
    }
  }
}

}  // namespace
}  // namespace proofmass::coordinator
