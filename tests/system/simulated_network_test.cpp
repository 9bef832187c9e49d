// A coordinator and its workers under a simulated network and clock that lose, repeat, delay and
// reorder messages, kill workers and restart the coordinator, all from a seed. Dispatch and
// conversation are the real ones; only what computes and what stores is played.

#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <queue>
#include <random>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/dispatch/dispatch.hpp"
#include "core/simulation/run.hpp"
#include "worker/net/conversation.hpp"

namespace proofmass {
namespace {

using namespace std::chrono_literals;
using coordinator::Duration;
using coordinator::TimePoint;
using coordinator::WorkerId;

constexpr std::uint64_t num_runs = 80;
constexpr int num_workers = 3;
constexpr Duration deadline = 2h;  // Of simulated time; half an hour is the usual worst.

/// A quarter of all worlds kills nothing: there, only the protocol itself can repair a loss.
constexpr double never_s = 1e9;

/// How bad the world is; drawn from the seed.
struct Weather {
  double loss = 0.0;        ///< Probability that a message is lost.
  double repetition = 0.0;  ///< Probability that it arrives twice.
  double delay_s_max = 0.0;
  double kill_s = 0.0;     ///< Mean time between kills of a worker.
  double restart_s = 0.0;  ///< Mean time between kills of the coordinator.
  double run_s_max = 0.0;
};

class Randomness {
 public:
  explicit Randomness(std::uint64_t seed) : engine_(seed) {}

  double uniform(double maximum) {
    return maximum * static_cast<double>(engine_() >> 11) / 9007199254740992.0;
  }
  bool happens(double probability) { return uniform(1.0) < probability; }
  Duration duration(double seconds_max) {
    return std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(uniform(seconds_max)));
  }

 private:
  std::mt19937_64 engine_;
};

/// Things that will happen, in the order of their time.
class Agenda {
 public:
  void add(TimePoint when, std::function<void()> what) {
    entries_.push({when, next_++, std::move(what)});
  }

  /// Makes the next thing happen.
  void step() {
    const Entry entry = entries_.top();
    entries_.pop();
    now_ = entry.when;
    entry.what();
  }

  [[nodiscard]] TimePoint now() const { return now_; }

 private:
  struct Entry {
    TimePoint when;
    std::uint64_t number;
    std::function<void()> what;
    bool operator<(const Entry& other) const {
      return std::pair(other.when, other.number) < std::pair(when, number);
    }
  };
  std::priority_queue<Entry> entries_;
  std::uint64_t next_ = 0;
  TimePoint now_{};
};

/// Computes runs in simulated time, one after the other.
class PlayedExecution final : public worker::Execution {
 public:
  void start(std::shared_ptr<const Campaign>) override { queue_.clear(); }
  void submit(wire::RunLease lease) override {
    for (std::uint64_t run = lease.runs.first.value; run < lease.runs.end(); ++run) {
      queue_.push_back({lease.lease, lease.attempt, {.result = {.run = {run}}, .compute_s = 0.7}});
    }
  }
  void abandon() override { queue_.clear(); }
  std::vector<worker::FinishedRun> take_finished() override { return std::exchange(finished_, {}); }
  std::vector<wire::LeaseId> open_leases() const override {
    std::vector<wire::LeaseId> leases;
    for (const auto& run : queue_) leases.push_back(run.lease);
    return leases;
  }
  std::uint64_t num_orbits_done() const override { return 0; }
  std::optional<std::string> failure() const override { return std::nullopt; }

  /// Finishes the run at hand, if any.
  bool finish_run() {
    if (queue_.empty()) return false;
    finished_.push_back(queue_.front());
    queue_.pop_front();
    return true;
  }

 private:
  std::deque<worker::FinishedRun> queue_;
  std::vector<worker::FinishedRun> finished_;
};

class World final : public coordinator::Outbox {
 public:
  explicit World(std::uint64_t seed) : random_(seed) {
    weather_ = {.loss = random_.uniform(0.3),
                .repetition = random_.uniform(0.2),
                .delay_s_max = random_.uniform(3.0),
                .kill_s = random_.happens(0.5) ? never_s : 20.0 + random_.uniform(100.0),
                .restart_s = random_.happens(0.5) ? never_s : 60.0 + random_.uniform(300.0),
                .run_s_max = random_.uniform(4.0)};
    Campaign campaign;
    campaign.num_runs = num_runs;
    campaign_ = std::make_shared<const Campaign>(campaign);
    restart_coordinator();
    for (int i = 0; i < num_workers; ++i) start_worker();
    tick_coordinator();
    plan_restart();
  }

  /// Until the campaign is finished or the deadline has passed.
  void run() {
    while (!is_finished(state_) && agenda_.now() < TimePoint{} + deadline) {
      agenda_.step();
      check_invariants(state_);
    }
  }

  [[nodiscard]] const std::map<RunIndex, int>& num_commits() const { return num_commits_; }
  [[nodiscard]] int num_kills() const { return num_kills_; }
  [[nodiscard]] int num_restarts() const { return num_restarts_; }
  [[nodiscard]] std::uint64_t attempt_max() const { return attempt_max_; }

  // Outbox.
  void send(WorkerId worker, wire::Message message) override {
    if (const auto* const lease = std::get_if<wire::RunLease>(&message)) {
      attempt_max_ = std::max<std::uint64_t>(attempt_max_, lease->attempt.value);
    }
    if (const auto* const ack = std::get_if<wire::ResultAck>(&message)) {
      for (const RunIndex run : ack->runs) {
        EXPECT_TRUE(num_commits_.contains(run)) << "acknowledged before the commit";
      }
    }
    transmit([this, worker, message] {
      const auto found = workers_.find(worker);
      if (found != workers_.end()) found->second.conversation->on_message(message, agenda_.now());
    });
  }
  void store(coordinator::Arrival arrival) override {
    const RunIndex run = arrival.computed.result.run;
    after(random_.duration(0.05), [this, run, life = num_restarts_] {
      if (life != num_restarts_) return;  // It was killed before the commit.
      ++num_commits_[run];
      on_committed(state_, std::vector{run}, *this);
    });
  }
  void log(coordinator::Event) override {}

 private:
  struct PlayedWorker {
    std::unique_ptr<PlayedExecution> execution;
    std::unique_ptr<worker::Conversation> conversation;
  };

  void after(Duration delay, std::function<void()> what) {
    agenda_.add(agenda_.now() + delay, std::move(what));
  }

  void transmit(const std::function<void()>& arrive) {
    if (!random_.happens(weather_.loss)) after(random_.duration(weather_.delay_s_max), arrive);
    if (random_.happens(weather_.repetition)) after(random_.duration(weather_.delay_s_max), arrive);
  }

  void start_worker() {
    const WorkerId id{next_worker_++};
    const wire::Hello hello{.worker_name = "w",
                            .host = "h",
                            .process_id = id.value,
                            .num_slots = 1,
                            .model_version = std::string(model_version)};
    PlayedWorker& played = workers_[id];
    played.execution = std::make_unique<PlayedExecution>();
    const auto send_to_coordinator = [this, id](const wire::Message& message) {
      transmit([this, id, message] {
        std::visit([&](const auto& content) { arrive(id, content); }, message);
      });
    };
    played.conversation = std::make_unique<worker::Conversation>(
        hello, *played.execution, send_to_coordinator, agenda_.now());
    tick_worker(id);
    compute(id);
    after(random_.duration(2.0 * weather_.kill_s), [this, id] { replace_worker(id); });
  }

  void replace_worker(WorkerId id) {
    ++num_kills_;
    workers_.erase(id);
    after(random_.duration(10.0), [this] { start_worker(); });
  }

  void tick_worker(WorkerId id) {
    const auto found = workers_.find(id);
    if (found == workers_.end()) return;
    found->second.conversation->on_tick(agenda_.now());
    after(500ms, [this, id] { tick_worker(id); });
  }

  void compute(WorkerId id) {
    const auto found = workers_.find(id);
    if (found == workers_.end()) return;
    if (found->second.execution->finish_run()) {
      found->second.conversation->on_progress(agenda_.now());
    }
    after(10ms + random_.duration(weather_.run_s_max), [this, id] { compute(id); });
  }

  void tick_coordinator() {
    on_tick(state_, agenda_.now(), *this);
    after(500ms, [this] { tick_coordinator(); });
  }

  void plan_restart() {
    after(random_.duration(2.0 * weather_.restart_s), [this] {
      ++num_restarts_;
      restart_coordinator();
      plan_restart();
    });
  }

  /// All that a coordinator remembers is what has been committed.
  void restart_coordinator() {
    coordinator::RunSet finished;
    for (const auto& [run, count] : num_commits_) finished.add({.first = run, .count = 1});
    state_ = coordinator::initial_state(campaign_, finished.ranges(), {});
  }

  void arrive(WorkerId id, const wire::Hello& hello) {
    on_hello(state_, id, hello, agenda_.now(), *this);
  }
  void arrive(WorkerId id, const wire::Credit& credit) {
    on_credit(state_, id, credit, agenda_.now(), *this);
  }
  void arrive(WorkerId id, const wire::ResultBatch& batch) {
    on_results(state_, id, batch, agenda_.now(), *this);
  }
  void arrive(WorkerId id, const wire::Heartbeat& heartbeat) {
    on_heartbeat(state_, id, heartbeat, agenda_.now(), *this);
  }
  void arrive(WorkerId id, const wire::Bye&) { on_bye(state_, id, agenda_.now(), *this); }
  template <typename Other>
  void arrive(WorkerId, const Other&) {
    ADD_FAILURE() << "a worker sent what only a coordinator sends";
  }

  Randomness random_;
  Weather weather_;
  Agenda agenda_;
  std::shared_ptr<const Campaign> campaign_;  // Shared with the dispatch, as its interface has it.
  coordinator::State state_;
  std::map<WorkerId, PlayedWorker> workers_;
  std::map<RunIndex, int> num_commits_;
  std::uint64_t next_worker_ = 1;
  std::uint64_t attempt_max_ = 0;
  int num_kills_ = 0;
  int num_restarts_ = 0;
};

TEST(SimulatedNetwork, EveryRunIsCommittedExactlyOnce) {
  int num_kills = 0;
  int num_restarts = 0;
  std::uint64_t attempt_max = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    World world(seed);
    world.run();
    ASSERT_EQ(world.num_commits().size(), num_runs) << "seed " << seed;
    for (const auto& [run, count] : world.num_commits()) {
      ASSERT_EQ(count, 1) << "seed " << seed << ", run " << run.value;
    }
    num_kills += world.num_kills();
    num_restarts += world.num_restarts();
    attempt_max = std::max(attempt_max, world.attempt_max());
  }
  // The world was bad enough to mean something.
  EXPECT_GT(num_kills, 1000);
  EXPECT_GT(num_restarts, 100);
  EXPECT_GE(attempt_max, 4U);
}

}  // namespace
}  // namespace proofmass
