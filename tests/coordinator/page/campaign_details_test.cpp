#include "coordinator/page/campaign_details.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <condition_variable>
#include <ctime>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include "core/microscope/definition/campaign_definition.hpp"
#include "core/model.hpp"
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

/// The campaign of a file `NAME.db`, or of another name.
CampaignRecord record(const std::filesystem::path& file, std::uint64_t num_done = 0,
                      const std::string& name = "") {
  CampaignRecord campaign{.file = file};
  campaign.status.set_name(name.empty() ? file.stem().string() : name);
  campaign.status.set_num_done(num_done);
  return campaign;
}

/// A reader whose databases are played; counts how often each is read.
class DetailReaderTest : public ::testing::Test {
 protected:
  DetailSources sources() {
    return {.read_events =
                [this](const CampaignRecord& campaign, const CampaignEvents* before) {
                  note("events " + campaign.file.string());
                  auto events = std::make_shared<CampaignEvents>();
                  events->events = before == nullptr ? decltype(events->events){} : before->events;
                  events->events.push_back({.id = events->events.size() + 1});
                  return events;
                },
            .read_results =
                [this](const CampaignRecord& campaign, const CampaignResults* before) {
                  note("results " + campaign.file.string());
                  auto results = std::make_shared<CampaignResults>();
                  results->html = "<p>" + campaign.file.string() + "</p>";
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
  static CampaignDetails whole(DetailReader& reader, const CampaignRecord& campaign) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (std::chrono::steady_clock::now() < end) {
      CampaignDetails details = reader.details(campaign, std::chrono::steady_clock::now());
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
  const CampaignDetails first = reader.details(record("a.db"), std::chrono::steady_clock::now());
  EXPECT_EQ(first.events, nullptr);  // It never waits.
  const CampaignDetails details = whole(reader, record("a.db"));
  EXPECT_EQ(details.results->html, "<p>a.db</p>");
  EXPECT_EQ(details.events->events.size(), 1U);
}

TEST_F(DetailReaderTest, ReadsEventsFurtherAndResultsOnlyIfThereAreMore) {
  DetailReader reader(sources());
  const CampaignRecord subject = record("a.db", 5);
  (void)whole(reader, subject);
  wait_for("events a.db", 2);  // Two seconds later.
  EXPECT_EQ(count_of("results a.db"), 1);
  (void)reader.details(record("a.db", 6), std::chrono::steady_clock::now());
  wait_for("results a.db", 2);
  EXPECT_GE(whole(reader, subject).events->events.size(), 2U);
}

// A part of five results at a time.
TEST_F(DetailReaderTest, ReadsResultsFurtherUntilItHasThoseThatAreFinished) {
  DetailReader reader(sources());
  const CampaignRecord subject = record("a.db", 10);
  (void)whole(reader, subject);
  wait_for("results a.db", 2);
  wait_for("events a.db", 3);
  EXPECT_EQ(count_of("results a.db"), 2);
  EXPECT_EQ(whole(reader, subject).results->num_runs, 10U);
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
  played.read_events = [&, read = played.read_events](const CampaignRecord& campaign,
                                                      const CampaignEvents* before) {
    begun.push_back(std::chrono::steady_clock::now());
    work_for(cpu_time);
    ended.push_back(std::chrono::steady_clock::now());
    return read(campaign, before);
  };
  {
    DetailReader reader(played);
    for (const std::string name : {"a", "b", "c"}) {
      (void)reader.details(record(name + ".db"), std::chrono::steady_clock::now());
    }
    for (const std::string name : {"a", "b", "c"}) wait_for("events " + name + ".db", 1);
  }
  ASSERT_GE(begun.size(), 3U);
  for (std::size_t i = 1; i < begun.size(); ++i) EXPECT_GE(begun[i] - ended[i - 1], 75 * cpu_time);
}

TEST_F(DetailReaderTest, BeginsAnewWithAnotherFileOfThatName) {
  DetailReader reader(sources());
  (void)whole(reader, record("a.db"));
  EXPECT_EQ(whole(reader, record("b.db", 0, "a")).results->html, "<p>b.db</p>");
}

TEST_F(DetailReaderTest, BeginsAnewWithAnotherCampaignInThatFile) {
  DetailReader reader(sources());
  CampaignRecord first = record("a.db", 5), second = first;
  first.id = {1};
  second.id = {2};
  (void)whole(reader, first);
  EXPECT_EQ(reader.details(second, std::chrono::steady_clock::now()).results, nullptr);
  EXPECT_EQ(whole(reader, second).results->num_runs, 5U);
}

// The file is an older copy now, or the number was older than the reading.
TEST_F(DetailReaderTest, ReadsResultsAgainIfFewerAreFinishedThanItRead) {
  DetailReader reader(sources());
  (void)whole(reader, record("a.db", 5));
  (void)reader.details(record("a.db", 4), std::chrono::steady_clock::now());
  wait_for("results a.db", 2);
}

TEST_F(DetailReaderTest, TriesAgainWhatCouldNotBeRead) {
  DetailSources played = sources();
  played.read_results = [this](const CampaignRecord&, const CampaignResults* before) {
    note("results");
    auto results = std::make_shared<CampaignResults>();
    if (before == nullptr) results->failure = "not now";
    return results;
  };
  DetailReader reader(played);
  EXPECT_EQ(whole(reader, record("a.db")).results->failure, "not now");
  wait_for("results", 2);
}

// As if memory were short in its own code.
TEST_F(DetailReaderTest, GoesOnAfterAnException) {
  DetailSources played = sources();
  played.read_events = [this, read = played.read_events](const CampaignRecord& campaign,
                                                         const CampaignEvents* before) {
    note("tried");
    if (count_of("tried") == 1) throw std::bad_alloc();
    return read(campaign, before);
  };
  DetailReader reader(played);
  EXPECT_EQ(whole(reader, record("a.db")).events->events.size(), 1U);
}

TEST_F(DetailReaderTest, KeepsABoundedNumberOfCampaigns) {
  DetailReader reader(sources());
  const auto now = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < DetailReader::num_campaigns_max; ++i) {
    EXPECT_EQ(reader.details(record(fmt::format("c{}.db", i)), now).events, nullptr);
  }
  const CampaignDetails none = reader.details(record("more.db"), now + 1s);
  ASSERT_NE(none.events, nullptr);
  EXPECT_EQ(none.events->failure,
            "campaigns that are looked at = 64 (must be fewer; try again in 60 s)");
  EXPECT_EQ(none.results->failure, none.events->failure);
  // Those that were asked for before are still there, read by now or not, and one gives its place
  // when it is not wanted any more.
  const CampaignDetails kept = reader.details(record("c0.db"), now + 2s);
  EXPECT_TRUE(kept.results == nullptr || kept.results->failure.empty());
  EXPECT_EQ(reader.details(record("more.db"), now + 61s).events, nullptr);
}

class DatabaseDetails : public test::StoreTest {
 protected:
  /// Errors of these results grow with the run: the last one is the worst.
  Store made(std::uint64_t num_results) {
    const MicroscopeCampaign campaign = test::campaign_of(num_results + 9);
    Store store = Store::create(file(), campaign, canonical_definition(campaign));
    std::vector<Entry> entries{test::worker_1()};
    for (const Delivery& delivery : test::deliveries_of(0, num_results)) {
      entries.emplace_back(delivery);
    }
    for (const char* text : {"first", "second"}) {
      entries.emplace_back(EventEntry{.kind = "kind", .text = text});
    }
    (void)store.write(entries);
    return store;
  }
  void add(Store& store, std::uint64_t first_run, std::uint64_t end, const char* text) {
    std::vector<Entry> entries{EventEntry{.kind = "kind", .text = text}};
    for (const Delivery& delivery : test::deliveries_of(first_run, end)) {
      entries.emplace_back(delivery);
    }
    (void)store.write(entries);
  }
  [[nodiscard]] std::shared_ptr<const CampaignResults> results_after(
      std::uint64_t num_finished, const CampaignResults* before) const {
    return sources_.read_results(record(file(), num_finished), before);
  }
  [[nodiscard]] std::vector<std::string> texts_after(const CampaignEvents* before) {
    events_ = sources_.read_events(record(file()), before);
    std::vector<std::string> texts;
    for (const StoredEvent& event : events_->events) texts.push_back(event.text);
    return texts;
  }

  const DetailSources sources_ = database_sources();
  std::shared_ptr<const CampaignEvents> events_;
};

TEST_F(DatabaseDetails, GoOnAfterWhatWasRead) {
  Store store = made(3);
  const auto results = results_after(3, nullptr);
  EXPECT_THAT(texts_after(nullptr), testing::ElementsAre("first", "second"));
  add(store, 3, 5, "third");
  EXPECT_EQ(results_after(5, results.get())->num_runs, 5U);
  const auto before = events_;
  EXPECT_THAT(texts_after(before.get()), testing::ElementsAre("first", "second", "third"));
}

TEST_F(DatabaseDetails, AreThoseOfAnOlderCopyThatTookThePlaceOfTheFile) {
  const std::filesystem::path copy = directory() / "copy.db";
  std::shared_ptr<const CampaignResults> results;
  {
    Store store = made(3);
    store.back_up(copy);
    add(store, 3, 5, "third");
    add(store, 5, 6, "fourth");
    results = results_after(6, nullptr);
    (void)texts_after(nullptr);
    (void)store.rest();
  }
  const auto before = events_;
  std::filesystem::rename(copy, file());
  EXPECT_EQ(results_after(3, results.get())->num_runs, 3U);
  EXPECT_THAT(texts_after(before.get()), testing::ElementsAre("first", "second"));
}

// Results that were read are newer than the number of those that are finished. Begun anew, they
// would be those of one reading.
TEST_F(DatabaseDetails, AreKeptIfTheFileHasThem) {
  constexpr std::uint64_t num_results = page_results_a_reading + 100;
  const Store store = made(num_results);
  const auto part = results_after(num_results, nullptr);
  const auto results = results_after(num_results, part.get());
  EXPECT_EQ(results->num_runs, num_results);
  EXPECT_EQ(results_after(num_results - 1, results.get())->num_runs, num_results);
}

TEST_F(DatabaseDetails, AreThoseOfBeforeIfTheFileCannotBeRead) {
  std::shared_ptr<const CampaignResults> results;
  {
    Store store = made(3);
    results = results_after(3, nullptr);
    (void)texts_after(nullptr);
    (void)store.rest();
  }
  const auto before = events_;
  std::filesystem::rename(file(), directory() / "away.db");
  const auto again = results_after(3, results.get());
  EXPECT_THAT(again->failure, testing::HasSubstr("(does not exist)"));
  EXPECT_EQ(again->num_runs, 3U);
  EXPECT_EQ(again->html, results->html);
  EXPECT_THAT(texts_after(before.get()), testing::ElementsAre("first", "second"));
  EXPECT_THAT(events_->failure, testing::HasSubstr("(does not exist)"));
}

/// A campaign of 2,000 runs whose results come as a test wants them. Errors grow with the run.
class ResultsReadingTest : public test::StoreTest {
 protected:
  static Store made(const std::filesystem::path& path) {
    const auto campaign = test::campaign_of(2'000);
    Store store = Store::create(path, campaign, canonical_definition(campaign));
    (void)store.write(std::vector<Entry>{test::worker_1()});
    return store;
  }
  static void finish(Store& store, std::uint64_t first, std::uint64_t end, std::uint64_t step = 1) {
    std::vector<Entry> entries;
    for (std::uint64_t run = first; run < end; run += step) {
      entries.emplace_back(test::delivery_of(run));
    }
    (void)store.write(entries);
  }
  static std::uint64_t worst_run(const ResultsReading& reading) {
    return reading.results().statistics().accuracy[0].worst_run.value;
  }
};

TEST_F(ResultsReadingTest, ReadsEveryResultOnceAPartAtATime) {
  Store store = made(file());
  ResultsReading reading(store);
  reading.read_further(store, 100);
  EXPECT_EQ(reading.num_read(), 0U);
  finish(store, 0, 250);
  for (const std::uint64_t num_read : {100U, 200U, 250U, 250U}) {
    reading.read_further(store, 100);
    EXPECT_EQ(reading.num_read(), num_read);
    EXPECT_EQ(reading.results().statistics().num_runs, num_read);
  }
  EXPECT_EQ(worst_run(reading), 249U);
}

TEST_F(ResultsReadingTest, FindsWhatComesLaterInFrontOfWhatItHas) {
  Store store = made(file());
  finish(store, 100, 200);
  ResultsReading reading(store);
  reading.read_further(store, 60);
  finish(store, 0, 50);  // Before the place where it goes on.
  finish(store, 300, 310);
  for (int i = 0; i < 4; ++i) reading.read_further(store, 60);
  EXPECT_EQ(reading.num_read(), 160U);
  EXPECT_EQ(reading.results().statistics().num_runs, 160U);
}

// Each of a thousand gaps has to be looked up, and the lookups are bounded, too.
TEST_F(ResultsReadingTest, ComesThroughManyGaps) {
  Store store = made(file());
  finish(store, 0, 2'000, 2);
  ResultsReading reading(store);
  int num_parts = 0;
  for (; reading.num_read() < 1'000 && num_parts < 100; ++num_parts) {
    reading.read_further(store, 320);
  }
  finish(store, 1, 2'000, 2);
  for (; reading.num_read() < 2'000 && num_parts < 1'000; ++num_parts) {
    const std::uint64_t before = reading.num_read();
    reading.read_further(store, 320);
    EXPECT_LE(reading.num_read() - before, 10U);  // One a gap.
  }
  EXPECT_EQ(reading.num_read(), 2'000U);
  EXPECT_EQ(worst_run(reading), 1'999U);
}

TEST_F(ResultsReadingTest, KnowsItsCampaign) {
  const Store store = made(file());
  const Store other = made(directory() / "other.db");
  const ResultsReading reading(store);
  EXPECT_TRUE(reading.is_of(store));
  EXPECT_FALSE(reading.is_of(other));
}

}  // namespace
}  // namespace proofmass::coordinator
