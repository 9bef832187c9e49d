// Dispatch and conversation, the real ones, under a network that loses, repeats, delays and
// reorders messages and is cut, with workers and coordinators that die, files that are missing or
// older than they were, hosts that lie, and everything else that goes wrong in a campaign of some
// days; all from a seed. Each world ends with every run committed once; no worker throws a result
// away that somebody may need, and none that does nothing wrong is sent away.
//
// PROOFMASS_SEED=n replays one world and prints the coordinator's log; PROOFMASS_SEEDS=n plays the
// first n worlds, which should be 20,000 after a change of the dispatch or of a worker's
// conversation; PROOFMASS_TOTALS=1 prints how often each event occurred.

#include <cstdio>

#include "tests/system/simulated_network_world.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

constexpr std::uint64_t num_shards = 4;
constexpr std::uint64_t num_seeds = 4'000;

std::optional<std::uint64_t> number_in(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  return std::stoull(text);
}

/// What happened in all worlds of a shard.
struct Totals {
  Incidents incidents;
  std::uint32_t attempt_max = 0;
  std::map<std::string, std::uint64_t> events;

  void add(const World& world) {
    const Incidents& others = world.incidents();
    incidents.num_deaths += others.num_deaths;
    incidents.num_crashes += others.num_crashes;
    incidents.num_restarts += others.num_restarts;
    incidents.num_given_up += others.num_given_up;
    incidents.num_compared += others.num_compared;
    incidents.num_spooled += others.num_spooled;
    incidents.num_lies += others.num_lies;
    incidents.num_released += others.num_released;
    attempt_max = std::max(attempt_max, world.coordinator().attempt_max());
    for (const auto& [kind, count] : world.coordinator().num_events()) events[kind] += count;
  }
};

/// Worlds of every `num_shards`th seed, so that they can be played side by side.
class SimulatedNetwork : public testing::TestWithParam<std::uint64_t> {
 protected:
  void play(std::uint64_t seed) {
    SCOPED_TRACE("replay with PROOFMASS_SEED=" + std::to_string(seed));
    World world(seed);
    world.run();
    if (!HasFatalFailure()) world.check_end();
    totals.add(world);
  }

  Totals totals;
};

TEST_P(SimulatedNetwork, EveryRunIsCommittedExactlyOnce) {
  if (const auto seed = number_in("PROOFMASS_SEED")) {
    if (*seed % num_shards == GetParam()) play(*seed);
    return;
  }
  const std::uint64_t last = number_in("PROOFMASS_SEEDS").value_or(num_seeds);
  for (std::uint64_t seed = 1; seed <= last && !HasFailure(); ++seed) {
    if (seed % num_shards == GetParam()) play(seed);
  }
  // The worlds were bad enough to mean something.
  const std::uint64_t num_worlds = last / num_shards;
  EXPECT_GT(totals.incidents.num_deaths, num_worlds);
  EXPECT_GT(totals.incidents.num_restarts, num_worlds / 4);
  EXPECT_GT(totals.incidents.num_crashes, num_worlds);
  EXPECT_GT(totals.incidents.num_given_up, num_worlds / 4);
  EXPECT_GT(totals.incidents.num_compared, 5 * num_worlds);
  EXPECT_GT(totals.attempt_max, 10U);
  EXPECT_GT(totals.incidents.num_spooled, num_worlds / 4);
  EXPECT_GT(totals.incidents.num_lies, num_worlds);
  EXPECT_GT(totals.incidents.num_released, num_worlds / 100);
  for (const char* const kind :
       {"silent", "hung", "never_arrived", "retracted", "preempted", "host_quarantined",
        "storage_recovered", "worker_refused", "file_not_opened", "file_opened_late",
        "finished_file_left_out", "name_lost", "results_lost_with_a_file", "campaign_extended",
        "extension_lost_with_a_file", "campaign_not_served", "runs_not_served", "service_stalled",
        "message_waited"}) {
    EXPECT_GT(totals.events[kind], num_worlds / 25) << kind;
  }
  if (std::getenv("PROOFMASS_TOTALS") == nullptr) return;
  for (const auto& [kind, count] : totals.events) {
    std::printf("%s %llu\n", kind.c_str(), static_cast<unsigned long long>(count));
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SimulatedNetwork, testing::Range<std::uint64_t>(0, num_shards));

}  // namespace
}  // namespace proofmass::test
