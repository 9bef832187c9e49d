#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/faults/planned_faults.hpp"

namespace proofmass::wire {
namespace {

using std::chrono::duration;
using std::chrono::milliseconds;
using test::refusal_of;

constexpr LinkTime start{};
constexpr int num_messages = 20000;

struct Arrival {
  std::string bytes;
  LinkTime at;
};

LinkTime sent_at(int i) { return start + milliseconds(i); }

// Sends message i at i ms, each named by its number, to `num_peers` in turn; takes what is due each
// millisecond until the link is empty.
std::map<std::string, std::vector<Arrival>> arrivals(const std::string& plan, int num_peers = 1,
                                                     int count = num_messages) {
  FaultyLink link(FaultPlan::parse(plan), FaultyLink::Direction::sending);
  std::map<std::string, std::vector<Arrival>> arrived;
  for (int i = 0; i < count || link.next_due(); ++i) {
    if (i < count) link.pass(std::to_string(i % num_peers), std::to_string(i), sent_at(i));
    for (Parcel& parcel : link.due(sent_at(i))) {
      arrived[parcel.routing].push_back({std::move(parcel.bytes), sent_at(i)});
    }
  }
  return arrived;
}

// Five standard deviations of a binomial count.
double bound(double p, int n = num_messages) { return 5.0 * std::sqrt(n * p * (1.0 - p)); }

TEST(FaultyLink, WithoutFaultsPassesAllAtOnceAndInOrder) {
  const auto arrived = arrivals("seed=3");
  ASSERT_EQ(arrived.at("0").size(), std::size_t{num_messages});
  for (int i = 0; i < num_messages; ++i) {
    EXPECT_EQ(arrived.at("0")[static_cast<std::size_t>(i)].bytes, std::to_string(i));
    EXPECT_EQ(arrived.at("0")[static_cast<std::size_t>(i)].at, sent_at(i));
  }
}

TEST(FaultyLink, DropsAsManyAsPlanned) {
  const auto num_lost = num_messages - static_cast<int>(arrivals("drop=0.1").at("0").size());
  EXPECT_NEAR(num_lost, 0.1 * num_messages, bound(0.1));
  EXPECT_TRUE(arrivals("drop=1").empty());
}

TEST(FaultyLink, DuplicatesAsManyAsPlanned) {
  const auto arrived = arrivals("duplicate=0.05").at("0");
  EXPECT_NEAR(static_cast<double>(arrived.size()) - num_messages, 0.05 * num_messages, bound(0.05));
  std::map<std::string, int> counts;
  for (const Arrival& arrival : arrived) ++counts[arrival.bytes];
  EXPECT_EQ(counts.size(), std::size_t{num_messages});
  for (const auto& [bytes, count] : counts) EXPECT_LE(count, 2) << bytes;
}

TEST(FaultyLink, DelaysUniformlyUpToThePlan) {
  const auto arrived = arrivals("delay=0.2:2.0").at("0");
  ASSERT_EQ(arrived.size(), std::size_t{num_messages});
  int num_late = 0;
  double sum_s = 0.0;
  for (const Arrival& arrival : arrived) {
    const double late_s = duration<double>(arrival.at - sent_at(std::stoi(arrival.bytes))).count();
    EXPECT_LE(late_s, 2.001);  // What is due is taken each millisecond.
    if (late_s == 0.0) continue;
    ++num_late;
    sum_s += late_s;
  }
  EXPECT_NEAR(num_late, 0.2 * num_messages, bound(0.2));
  // A uniform number's standard deviation is its range by √12; half a millisecond of waiting.
  EXPECT_NEAR(sum_s / num_late, 1.0005, 5.0 * 2.0 / std::sqrt(12.0 * num_late));
}

TEST(FaultyLink, CopiesAreDelayedEachByItself) {
  std::map<std::string, std::vector<LinkTime>> times;
  const auto arrived = arrivals("duplicate=1,delay=1:2.0", 1, 1000);
  for (const Arrival& arrival : arrived.at("0")) {
    times[arrival.bytes].push_back(arrival.at);
  }
  const auto num_together = std::ranges::count_if(
      times, [](const auto& entry) { return entry.second[0] == entry.second[1]; });
  EXPECT_LT(num_together, 10);  // Of 1000 pairs in 2000 ms: 1 is expected.
}

TEST(FaultyLink, ReorderedMessageIsOvertakenByTheNextOfItsPeer) {
  const auto arrived = arrivals("reorder=0.1", 3);
  int num_overtaken = 0;
  for (const auto& [peer, messages] : arrived) {
    int latest = -1;
    for (const Arrival& arrival : messages) {
      const int number = std::stoi(arrival.bytes);
      if (number < latest) ++num_overtaken;
      latest = std::max(latest, number);
    }
  }
  EXPECT_NEAR(num_overtaken, 0.1 * num_messages, bound(0.1));
}

TEST(FaultyLink, ReorderedMessageThatNothingOvertakesGoesAlone) {
  FaultyLink link(FaultPlan::parse("reorder=1"), FaultyLink::Direction::sending);
  link.pass("peer", "only", start);
  EXPECT_TRUE(link.due(start + milliseconds(499)).empty());
  ASSERT_EQ(link.next_due(), start + milliseconds(500));
  ASSERT_EQ(link.due(start + milliseconds(500)).size(), 1u);
  link.pass("peer", "later", start + milliseconds(600));
  EXPECT_EQ(link.due(start + milliseconds(1100)).size(), 1u);
  EXPECT_FALSE(link.next_due());
}

TEST(FaultyLink, CutLosesAllOfOnePeerForAWhile) {
  FaultyLink link(FaultPlan::parse("seed=1,cut=0.001:3.0"), FaultyLink::Direction::sending);
  std::map<std::string, std::vector<bool>> has_arrived;
  for (int i = 0; i < num_messages; ++i) {
    const std::string peer = std::to_string(i % 2);
    link.pass(peer, "", sent_at(i));
    has_arrived[peer].push_back(!link.due(sent_at(i)).empty());
  }
  for (const auto& [peer, arrived] : has_arrived) {
    // Messages of one peer are 2 ms apart: a cut swallows the first and those of 3 s after it.
    std::vector<std::ptrdiff_t> gaps;
    for (auto at = arrived.begin(); at != arrived.end();) {
      const auto begin = std::find(at, arrived.end(), false);
      at = std::find(begin, arrived.end(), true);
      if (at != arrived.end()) gaps.push_back(at - begin);
    }
    ASSERT_FALSE(gaps.empty());
    for (const auto gap : gaps) EXPECT_EQ(gap % 1500, 0) << gap;
  }
  EXPECT_NE(has_arrived.at("0"), has_arrived.at("1"));
}

TEST(FaultyLink, KeepsNothingForEver) {
  const auto arrived = arrivals("delay=0.5:5.0,reorder=0.5,duplicate=0.3", 7, 2000);
  std::size_t num_arrived = 0;
  for (const auto& [peer, messages] : arrived) num_arrived += messages.size();
  EXPECT_GE(num_arrived, 2000u);
}

std::vector<std::pair<std::string, LinkTime>> schedule(const std::string& plan,
                                                       FaultyLink::Direction direction) {
  FaultyLink link(FaultPlan::parse(plan), direction);
  std::vector<std::pair<std::string, LinkTime>> taken;
  for (int i = 0; i < 3000; ++i) {
    if (i < 1000) link.pass(i % 3 == 0 ? "a" : "b", std::to_string(i), sent_at(i));
    for (Parcel& parcel : link.due(sent_at(i))) {
      taken.emplace_back(parcel.routing + std::move(parcel.bytes), sent_at(i));
    }
  }
  return taken;
}

TEST(FaultyLink, ScheduleIsAFunctionOfSeedAndDirection) {
  const std::string plan = "drop=0.1,delay=0.2:1.0,duplicate=0.05,reorder=0.1,cut=0.01:0.1";
  const auto one = schedule("seed=7," + plan, FaultyLink::Direction::sending);
  EXPECT_EQ(schedule("seed=7," + plan, FaultyLink::Direction::sending), one);
  EXPECT_NE(schedule("seed=8," + plan, FaultyLink::Direction::sending), one);
  EXPECT_NE(schedule("seed=7," + plan, FaultyLink::Direction::receiving), one);
}

TEST(FaultPlan, IsReadFromText) {
  const FaultPlan plan = FaultPlan::parse(
      "kill=after_commit:3,seed=7,drop=0.1,delay=0.2:2.0,duplicate=0.05,reorder=0.15,cut=0.01:3");
  EXPECT_EQ(plan.seed, 7u);
  EXPECT_EQ(plan.drop, 0.1);
  EXPECT_EQ(plan.delay.probability, 0.2);
  EXPECT_EQ(plan.delay.duration_s, 2.0);
  EXPECT_EQ(plan.duplicate, 0.05);
  EXPECT_EQ(plan.reorder, 0.15);
  EXPECT_EQ(plan.cut.probability, 0.01);
  EXPECT_EQ(plan.cut.duration_s, 3.0);
  ASSERT_TRUE(plan.kill);
  EXPECT_EQ(plan.kill->point, KillPoint::after_commit);
  EXPECT_EQ(plan.kill->passage, 3u);
}

TEST(FaultPlan, SaysWhatIsWrongWithItsText) {
  const auto refusal = [](const std::string& text) {
    return refusal_of([&] { (void)FaultPlan::parse(text); });
  };
  const std::string timed = " (must be PROBABILITY:SECONDS, in [0, 1] and in [0.001, 3600])";
  EXPECT_EQ(refusal(""), "faults =  (must be KEY=VALUE,...)");
  EXPECT_EQ(refusal("drop=0.1,"), "faults = drop=0.1, (must be KEY=VALUE,...)");
  EXPECT_EQ(refusal("drop"), "faults = drop (must be KEY=VALUE,...)");
  EXPECT_EQ(refusal("dorp=0.1"),
            "faults.dorp = 0.1 (must be seed, drop, duplicate, reorder, delay, cut or kill)");
  EXPECT_EQ(refusal("drop=0.1,drop=0.2"), "faults.drop = 0.2 (given twice)");
  for (const std::string value : {"2", "-0.1", "nan", "", "0.1x"}) {
    EXPECT_EQ(refusal("drop=" + value), "faults.drop = " + value + " (must be in [0, 1])");
  }
  EXPECT_EQ(refusal("seed=-1"), "faults.seed = -1 (must be in [0, 2^64))");
  for (const std::string value : {"0.1", "0.1:0", "2:1", "0.1:3601", "0.1:inf", "0.1:1:2"}) {
    EXPECT_EQ(refusal("delay=" + value), "faults.delay = " + value + timed);
    EXPECT_EQ(refusal("cut=" + value), "faults.cut = " + value + timed);
  }
  EXPECT_EQ(refusal("kill=after_lunch:1"), "faults.kill = after_lunch:1 (the point is unknown)");
  for (const std::string value : {"after_commit", "after_commit:0", "after_commit:"}) {
    EXPECT_EQ(refusal("kill=" + value),
              "faults.kill = " + value + " (must be POINT:PASSAGE, the passage from 1)");
  }
}

}  // namespace
}  // namespace proofmass::wire
