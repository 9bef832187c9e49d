#include "proto/link/log.hpp"

#include <nlohmann/json.hpp>

#include "core/error.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/proto/text/hostile_values.hpp"
#include "tests/support/faults/planned_faults.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

const std::chrono::system_clock::time_point noon =
    std::chrono::sys_days{std::chrono::year{2026} / 3 / 4} + 12h + 1234567us;

TEST(JsonLine, HasAMemberForEachField) {
  EXPECT_EQ(json_line({.severity = Severity::error,
                       .kind = "worker_crashed",
                       .fields = {{"signal", 11U},
                                  Field::remark("(Segmentation fault)"),
                                  {"restart_in_s", 1.0},
                                  Field::reason("told to stop"),
                                  Field::remark("again")}},
                      noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"error","event":"worker_crashed",)"
            R"("signal":11,"restart_in_s":1.0,"reason":"told to stop",)"
            R"json("text":"(Segmentation fault) again"})json");
  EXPECT_EQ(json_line({.severity = Severity::warning, .kind = "connected"}, noon),
            R"({"time":"2026-03-04T12:00:01.234Z","level":"warning","event":"connected"})");
}

TEST(JsonLine, HasTheValuesWhateverAFieldHolds) {
  for (const std::string_view hostile : test::hostile_values) {
    const std::string value(hostile);
    const std::string line =
        json_line({.kind = "refused",
                   .fields = {{"name", value}, Field::reason(value), Field::remark(value)}},
                  noon);
    const auto read = nlohmann::json::parse(line);
    const nlohmann::json expected{{"time", "2026-03-04T12:00:01.234Z"},
                                  {"level", "info"},
                                  {"event", "refused"},
                                  {"name", value},
                                  {"reason", value},
                                  {"text", value}};
    EXPECT_EQ(read, expected) << line;
    EXPECT_EQ(visible_text(line), line);
  }
}

TEST(JsonLine, IsJsonIfAPeerSaysWhatIsNotUtf8) {
  const auto read = nlohmann::json::parse(
      json_line({.kind = "malformed_message", .fields = {Field::remark("\xff\n\\ =x")}}, noon));
  EXPECT_EQ(read["text"], "\xef\xbf\xbd\n\\ =x");
}

/// What reaches standard error of an event worth knowing and of one that is wrong.
std::string written(const Log& log) {
  testing::internal::CaptureStderr();
  log({.kind = "worker_ended", .fields = {{"reason", "told"}}});
  log({.severity = Severity::warning, .kind = "worker_crashed", .fields = {{"signal", 11U}}});
  return testing::internal::GetCapturedStderr();
}

TEST(MakeLog, WritesLinesForPeople) {
  EXPECT_THAT(
      written(make_log("people", LogFormat::text, LogLevel::info)),
      testing::MatchesRegex("[[][^\n]*[]] [[]people[]] [[]info[]] worker_ended reason=told\n"
                            "[[][^\n]*[]] [[]people[]] [[]warning[]] worker_crashed signal=11\n"));
}

TEST(MakeLog, WritesAnObjectALineForPrograms) {
  EXPECT_THAT(written(make_log("programs", LogFormat::json, LogLevel::info)),
              testing::MatchesRegex(
                  R"([{]"time":"[^"]*","level":"info","event":"worker_ended","reason":"told"[}])"
                  "\n"
                  R"([{]"time":"[^"]*","level":"warning","event":"worker_crashed","signal":11[}])"
                  "\n"));
}

// A name from a file or a peer could steer the terminal, or look like an event of its own.
TEST(MakeLog, MakesWhatFilesAndPeersSayVisible) {
  for (const LogFormat format : {LogFormat::text, LogFormat::json}) {
    const Log log = make_log("visible", format, LogLevel::info);
    testing::internal::CaptureStderr();
    log({.kind = "refused", .fields = {{"name", "\x1b[2J\n[2026] forged\xe2\x80\xae"}}});
    const std::string text = testing::internal::GetCapturedStderr();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_THAT(text, testing::HasSubstr("u001b[2J"));
    EXPECT_THAT(text, testing::HasSubstr("u202e"));
    EXPECT_EQ(text.find('\x1b'), std::string::npos);
    EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos);
  }
}

TEST(MakeLog, LeavesOutWhatIsBelowItsLevel) {
  const std::string text = written(make_log("quiet", LogFormat::text, LogLevel::warning));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("worker_ended")));
  EXPECT_THAT(text, testing::HasSubstr("worker_crashed"));
}

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

}  // namespace
}  // namespace proofmass::wire
