#include "coordinator/page/campaign_details.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <condition_variable>
#include <ctime>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/campaign/model.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using namespace std::chrono_literals;

TEST(NextReading, ComesAfterTwoSecondsOrHundredAndFiftyTimesWhatTheLastTook) {
  const TimePoint ended{1000s};
  EXPECT_EQ(next_reading(ended, 0s), ended + 2s);
  EXPECT_EQ(next_reading(ended, 10ms), ended + 2s);
  EXPECT_EQ(next_reading(ended, 100ms), ended + 15s);
  EXPECT_EQ(next_reading(ended, 8s), ended + 1200s);
}

TEST(EndOfRest, ComesAfterSeventyFiveTimesWhatTheLastTook) {
  const TimePoint ended{1000s};
  EXPECT_EQ(end_of_rest(ended, 0s), ended);
  EXPECT_EQ(end_of_rest(ended, 40ms), ended + 3s);
}

/// A reader whose databases are played; counts how often each is read.
class DetailReaderTest : public ::testing::Test {
 protected:
  DetailSources sources() {
    return {.read_events =
                [this](const std::filesystem::path& file, const CampaignEvents* before) {
                  note("events " + file.string());
                  auto events = std::make_shared<CampaignEvents>();
                  events->events = before == nullptr ? decltype(events->events){} : before->events;
                  events->events.push_back({.id = events->events.size() + 1});
                  return events;
                },
            .read_results =
                [this](const std::filesystem::path& file, const CampaignResults* before) {
                  note("results " + file.string());
                  auto results = std::make_shared<CampaignResults>();
                  results->html = "<p>" + file.string() + "</p>";
                  results->num_runs = (before == nullptr ? 0 : before->num_runs) + 5;
                  return results;
                }};
  }
  void note(const std::string& what) {
    const std::lock_guard lock(mutex_);
    ++counts_[what];
    changed_.notify_all();
  }
  void wait_for(const std::string& what, int count) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, 20s, [&] { return counts_[what] >= count; })) << what;
  }
  int count_of(const std::string& what) {
    const std::lock_guard lock(mutex_);
    return counts_[what];
  }
  /// Asks until both parts are there.
  static CampaignDetails whole(DetailReader& reader, const std::string& name,
                               const DetailSubject& subject) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (std::chrono::steady_clock::now() < end) {
      CampaignDetails details = reader.details(name, subject, std::chrono::steady_clock::now());
      if (details.events != nullptr && details.results != nullptr) return details;
      std::this_thread::yield();
    }
    ADD_FAILURE() << "the details never came";
    return {};
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, int> counts_;
};

TEST_F(DetailReaderTest, ReadsACampaignAtWhichSomebodyLooks) {
  DetailReader reader(sources());
  const CampaignDetails first =
      reader.details("a", {.file = "a.db"}, std::chrono::steady_clock::now());
  EXPECT_EQ(first.events, nullptr);  // It never waits.
  const CampaignDetails details = whole(reader, "a", {.file = "a.db"});
  EXPECT_EQ(details.results->html, "<p>a.db</p>");
  EXPECT_EQ(details.events->events.size(), 1U);
}

TEST_F(DetailReaderTest, ReadsEventsFurtherAndResultsOnlyIfThereAreMore) {
  DetailReader reader(sources());
  const DetailSubject subject{.file = "a.db", .num_finished = 5};
  (void)whole(reader, "a", subject);
  wait_for("events a.db", 2);  // Two seconds later.
  EXPECT_EQ(count_of("results a.db"), 1);
  (void)reader.details("a", {.file = "a.db", .num_finished = 6}, std::chrono::steady_clock::now());
  wait_for("results a.db", 2);
  EXPECT_GE(whole(reader, "a", subject).events->events.size(), 2U);
}

// A part of five results at a time.
TEST_F(DetailReaderTest, ReadsResultsFurtherUntilItHasThoseThatAreFinished) {
  DetailReader reader(sources());
  const DetailSubject subject{.file = "a.db", .num_finished = 7};
  (void)whole(reader, "a", subject);
  wait_for("results a.db", 2);
  wait_for("events a.db", 3);
  EXPECT_EQ(count_of("results a.db"), 2);
  EXPECT_EQ(whole(reader, "a", subject).results->num_runs, 10U);
}

/// Uses so much time of the processor.
void work_for(std::chrono::nanoseconds cpu_time) {
  const auto used = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  };
  const auto end = used() + cpu_time;
  while (used() < end) {
  }
}

// Another campaign is no reason to read earlier.
TEST_F(DetailReaderTest, RestsAfterEachReadingWhateverIsNext) {
  constexpr auto cpu_time = 5ms;
  DetailSources played = sources();
  std::vector<TimePoint> begun, ended;  // Of the reader's thread.
  played.read_events = [&, read = played.read_events](const std::filesystem::path& file,
                                                      const CampaignEvents* before) {
    begun.push_back(std::chrono::steady_clock::now());
    work_for(cpu_time);
    ended.push_back(std::chrono::steady_clock::now());
    return read(file, before);
  };
  {
    DetailReader reader(played);
    for (const std::string name : {"a", "b", "c"}) {
      (void)reader.details(name, {.file = name + ".db"}, std::chrono::steady_clock::now());
    }
    for (const std::string name : {"a", "b", "c"}) wait_for("events " + name + ".db", 1);
  }
  ASSERT_GE(begun.size(), 3U);
  for (std::size_t i = 1; i < begun.size(); ++i) EXPECT_GE(begun[i] - ended[i - 1], 75 * cpu_time);
}

TEST_F(DetailReaderTest, BeginsAnewWithAnotherFileOfThatName) {
  DetailReader reader(sources());
  (void)whole(reader, "a", {.file = "a.db"});
  EXPECT_EQ(whole(reader, "a", {.file = "b.db"}).results->html, "<p>b.db</p>");
}

TEST_F(DetailReaderTest, KeepsABoundedNumberOfCampaigns) {
  DetailReader reader(sources());
  (void)whole(reader, "first", {.file = "first.db"});
  for (std::size_t i = 0; i < DetailReader::num_campaigns_max; ++i) {
    const std::string name = "c" + std::to_string(i);
    (void)whole(reader, name, {.file = name + ".db"});
  }
  const auto now = std::chrono::steady_clock::now();
  EXPECT_EQ(reader.details("first", {.file = "first.db"}, now).events, nullptr);
}

using DatabaseResults = test::StoreTest;

// Errors of these results grow with the run: the last one is the worst.
TEST_F(DatabaseResults, AreReadForPeopleAndForPrograms) {
  Store store =
      Store::create(file(), test::campaign_of(3), canonical_definition(test::campaign_of(3)));
  std::vector<Entry> entries{test::worker_1()};
  for (const Delivery& delivery : test::deliveries_of(0, 3)) entries.emplace_back(delivery);
  (void)store.write(entries);
  const auto results = database_sources().read_results(file(), nullptr);
  EXPECT_EQ(results->failure, "");
  EXPECT_EQ(results->num_runs, 3U);
  EXPECT_THAT(results->html, testing::HasSubstr("Accuracy so far"));
  const auto parameters = nlohmann::json::parse(results->json);
  ASSERT_EQ(parameters.size(), model().results().quantities.size());
  EXPECT_EQ(parameters[0]["worst"], std::abs(test::result_of(2).error(0)));
  EXPECT_EQ(parameters[0]["worst_run"], 2);
}

TEST(DatabaseSources, SayWhyAFileCannotBeRead) {
  const DetailSources sources = database_sources();
  EXPECT_THAT(sources.read_events("/nowhere/a.db", nullptr)->failure,
              testing::HasSubstr("/nowhere/a.db"));
  EXPECT_THAT(sources.read_results("/nowhere/a.db", nullptr)->failure,
              testing::HasSubstr("/nowhere/a.db"));
}

}  // namespace
}  // namespace proofmass::coordinator
