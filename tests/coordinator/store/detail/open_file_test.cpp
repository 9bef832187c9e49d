#include "coordinator/store/detail/open_file.hpp"

#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator::detail {
namespace {

using std::chrono::seconds;
using test::delivery_of;

constexpr TimePoint start{};

EventEntry event(const std::string& kind) { return {.kind = kind, .text = ""}; }

ReturnedRuns loss() {
  return {.runs = {RunIndex{0}, 1}, .attempt = {1}, .worker = test::session_1};
}

std::vector<std::string> kinds_of(const std::vector<Entry>& entries) {
  std::vector<std::string> kinds;
  for (const Entry& entry : entries) {
    const auto* found = std::get_if<EventEntry>(&entry);
    kinds.push_back(found == nullptr ? "other" : found->kind);
  }
  return kinds;
}

TEST(WaitingEntries, AreTakenInTheOrderInWhichTheyCame) {
  WaitingEntries waiting(10);
  for (const std::string kind : {"a", "b", "c"}) waiting.add(event(kind), start);
  std::vector<Entry> taken;
  waiting.take(2, taken, start);
  EXPECT_THAT(kinds_of(taken), ::testing::ElementsAre("a", "b"));
  waiting.take(2, taken, start);
  EXPECT_THAT(kinds_of(taken), ::testing::ElementsAre("a", "b", "c"));
  EXPECT_EQ(waiting.size(), 0u);
}

TEST(WaitingEntries, KnowHowManyResultsWaitAndSinceWhen) {
  WaitingEntries waiting(10);
  EXPECT_EQ(waiting.waiting_since(), std::nullopt);
  waiting.add(event("a"), start + seconds(1));
  waiting.add(delivery_of(0), start + seconds(2));
  waiting.add(SecondDelivery{delivery_of(0)}, start + seconds(3));
  waiting.add(GivenUpRun{RunIndex{1}}, start + seconds(3));
  EXPECT_EQ(waiting.num_results(), 2u);
  EXPECT_EQ(waiting.waiting_since(), start + seconds(1));

  std::vector<Entry> taken;
  waiting.take(2, taken, start + seconds(5));
  EXPECT_EQ(waiting.num_results(), 1u);
  EXPECT_EQ(waiting.waiting_since(), start + seconds(5));
  waiting.take(2, taken, start + seconds(6));
  EXPECT_EQ(waiting.num_results(), 0u);
  EXPECT_EQ(waiting.waiting_since(), std::nullopt);
}

TEST(WaitingEntries, KnowSinceWhenSomethingUrgentWaits) {
  WaitingEntries waiting(10);
  waiting.add(event("a"), start + seconds(1));
  EXPECT_EQ(waiting.urgent_since(), std::nullopt);
  waiting.add(CampaignControl{}, start + seconds(2));
  waiting.add(delivery_of(0), start + seconds(3));
  EXPECT_EQ(waiting.urgent_since(), start + seconds(2));
  std::vector<Entry> taken;
  waiting.take(2, taken, start + seconds(5));
  EXPECT_EQ(waiting.urgent_since(), start + seconds(5));
  waiting.add(event("b"), start + seconds(6));
  waiting.take(1, taken, start + seconds(7));
  EXPECT_EQ(waiting.urgent_since(), std::nullopt);
  EXPECT_EQ(waiting.waiting_since(), start + seconds(7));
}

TEST(WaitingEntries, DropLossesAndEventsBeyondTheLimitAndSaySo) {
  WaitingEntries waiting(2);
  waiting.add(event("a"), start);
  waiting.add(loss(), start);
  waiting.add(event("dropped"), start);
  waiting.add(loss(), start);
  waiting.add(delivery_of(0), start);  // Never dropped, like all that somebody waits for.
  waiting.add(GivenUpRun{RunIndex{1}}, start);
  waiting.add(test::worker_1(), start);
  waiting.add(CampaignControl{}, start);

  std::vector<Entry> taken;
  waiting.take(100, taken, start);
  EXPECT_THAT(kinds_of(taken), ::testing::ElementsAre("a", "other", "other", "other", "other",
                                                      "other", "records_dropped"));
  EXPECT_EQ(std::get<EventEntry>(taken.back()).text,
            "losses_and_events=2 (the disk did not take them for too long)");

  waiting.add(event("b"), start);
  taken.clear();
  waiting.take(100, taken, start);
  EXPECT_THAT(kinds_of(taken), ::testing::ElementsAre("b"));
}

}  // namespace
}  // namespace proofmass::coordinator::detail
