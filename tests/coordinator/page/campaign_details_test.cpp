#include "coordinator/page/campaign_details.hpp"

#include <fmt/format.h>

#include <condition_variable>
#include <ctime>
#include <new>

#include "coordinator/report/report.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/coordinator/charts/markup_reading.hpp"
#include "tests/coordinator/report/review_fixture.hpp"
#include "tests/coordinator/store/store_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

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

/// A reader whose databases are played: each reading has one event and five results more. Counts
/// how often each is read.
class DetailReaderTest : public ::testing::Test {
 protected:
  ReadDetails played() {
    return [this](const CampaignRecord& campaign, const CampaignDetails* before) {
      note(campaign.file.string());
      CampaignDetails details = before == nullptr ? CampaignDetails() : *before;
      details.events.push_back({.id = details.events.size() + 1});
      details.html = "<p>" + campaign.file.string() + "</p>";
      details.num_runs += 5;
      return details;
    };
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
  /// Asks until something was read.
  static CampaignDetails read(DetailReader& reader, const CampaignRecord& campaign) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (std::chrono::steady_clock::now() < end) {
      const auto details = reader.details(campaign, std::chrono::steady_clock::now());
      if (details != nullptr) return *details;
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
  DetailReader reader(played());
  EXPECT_EQ(reader.details(record("a.db"), std::chrono::steady_clock::now()), nullptr);
  const CampaignDetails details = read(reader, record("a.db"));  // The first never waits.
  EXPECT_EQ(details.html, "<p>a.db</p>");
  EXPECT_EQ(details.events.size(), 1U);
}

TEST_F(DetailReaderTest, ReadsFurtherWhatItHas) {
  DetailReader reader(played());
  (void)read(reader, record("a.db"));
  wait_for("a.db", 3);  // Two and four seconds later.
  const CampaignDetails details = read(reader, record("a.db"));
  EXPECT_GE(details.events.size(), 2U);
  EXPECT_EQ(details.num_runs, 5 * details.events.size());
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
  std::vector<TimePoint> begun, ended;  // Of the reader's thread.
  const auto slowly = [&, read = played()](const CampaignRecord& campaign,
                                           const CampaignDetails* before) {
    begun.push_back(std::chrono::steady_clock::now());
    work_for(cpu_time);
    ended.push_back(std::chrono::steady_clock::now());
    return read(campaign, before);
  };
  {
    DetailReader reader(slowly);
    for (const std::string name : {"a", "b", "c"}) {
      (void)reader.details(record(name + ".db"), std::chrono::steady_clock::now());
    }
    for (const std::string name : {"a", "b", "c"}) wait_for(name + ".db", 1);
  }
  ASSERT_GE(begun.size(), 3U);
  for (std::size_t i = 1; i < begun.size(); ++i) EXPECT_GE(begun[i] - ended[i - 1], 75 * cpu_time);
}

TEST_F(DetailReaderTest, BeginsAnewWithAnotherFileOfThatName) {
  DetailReader reader(played());
  (void)read(reader, record("a.db"));
  EXPECT_EQ(read(reader, record("b.db", 0, "a")).html, "<p>b.db</p>");
}

TEST_F(DetailReaderTest, BeginsAnewWithAnotherCampaignInThatFile) {
  DetailReader reader(played());
  CampaignRecord first = record("a.db"), second = first;
  first.id = {1};
  second.id = {2};
  (void)read(reader, first);
  EXPECT_EQ(reader.details(second, std::chrono::steady_clock::now()), nullptr);
  EXPECT_EQ(read(reader, second).num_runs, 5U);
}

TEST_F(DetailReaderTest, TriesAgainWhatCouldNotBeReadAndKeepsItsAge) {
  const auto failing = [this](const CampaignRecord&, const CampaignDetails* before) {
    note("tried");
    CampaignDetails details = before == nullptr ? CampaignDetails() : *before;
    if (before != nullptr) details.failure = "not now";
    return details;
  };
  DetailReader reader(failing);
  const TimePoint read_at = read(reader, record("a.db")).read_at;
  wait_for("tried", 3);
  const CampaignDetails details = read(reader, record("a.db"));
  EXPECT_EQ(details.failure, "not now");
  EXPECT_EQ(details.read_at, read_at);
}

// As if memory were short in its own code.
TEST_F(DetailReaderTest, GoesOnAfterAnException) {
  const auto short_of_memory = [this, read = played()](const CampaignRecord& campaign,
                                                       const CampaignDetails* before) {
    note("tried");
    if (count_of("tried") == 1) throw std::bad_alloc();
    return read(campaign, before);
  };
  DetailReader reader(short_of_memory);
  EXPECT_EQ(read(reader, record("a.db")).events.size(), 1U);
}

TEST_F(DetailReaderTest, KeepsABoundedNumberOfCampaigns) {
  DetailReader reader(played());
  const auto now = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < DetailReader::num_campaigns_max; ++i) {
    EXPECT_EQ(reader.details(record(fmt::format("c{}.db", i)), now), nullptr);
  }
  const auto none = reader.details(record("more.db"), now + 1s);
  ASSERT_NE(none, nullptr);
  EXPECT_EQ(none->failure, "campaigns that are looked at = 64 (must be fewer; try again in 60 s)");
  // Those that were asked for before are still there, read by now or not, and one gives its place
  // when it is not wanted any more.
  const auto kept = reader.details(record("c0.db"), now + 2s);
  EXPECT_TRUE(kept == nullptr || kept->failure.empty());
  EXPECT_EQ(reader.details(record("more.db"), now + 61s), nullptr);
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
  /// What a reading further than `before` has when so many runs are finished.
  [[nodiscard]] CampaignDetails details_after(std::uint64_t num_finished,
                                              const CampaignDetails* before) const {
    return read_details(record(file(), num_finished), before);
  }
  static std::vector<std::string> texts_of(const CampaignDetails& details) {
    std::vector<std::string> texts;
    for (const StoredEvent& event : details.events) texts.push_back(event.text);
    return texts;
  }
};

TEST_F(DatabaseDetails, GoOnAfterWhatWasRead) {
  Store store = made(3);
  const CampaignDetails first = details_after(3, nullptr);
  EXPECT_THAT(texts_of(first), testing::ElementsAre("first", "second"));
  add(store, 3, 5, "third");
  const CampaignDetails second = details_after(5, &first);
  EXPECT_EQ(second.num_runs, 5U);
  EXPECT_THAT(texts_of(second), testing::ElementsAre("first", "second", "third"));
}

// Results are read further only if there are others than those that were read.
TEST_F(DatabaseDetails, KeepTheirResultsWhileThereAreNoOthers) {
  Store store = made(3);
  const CampaignDetails first = details_after(3, nullptr);
  add(store, 3, 4, "third");
  const CampaignDetails second = details_after(3, &first);
  EXPECT_EQ(second.reading, first.reading);
  EXPECT_EQ(second.events.size(), 3U);
}

TEST_F(DatabaseDetails, AreThoseOfAnOlderCopyThatTookThePlaceOfTheFile) {
  const std::filesystem::path copy = directory() / "copy.db";
  CampaignDetails before;
  {
    Store store = made(3);
    store.back_up(copy);
    add(store, 3, 5, "third");
    add(store, 5, 6, "fourth");
    before = details_after(6, nullptr);
    (void)store.rest();
  }
  EXPECT_EQ(before.num_runs, 6U);
  std::filesystem::rename(copy, file());
  const CampaignDetails again = details_after(3, &before);
  EXPECT_EQ(again.num_runs, 3U);
  EXPECT_THAT(texts_of(again), testing::ElementsAre("first", "second"));
}

// Results that were read are newer than the number of those that are finished. Begun anew, they
// would be those of one reading.
TEST_F(DatabaseDetails, AreKeptIfTheFileHasThem) {
  constexpr std::uint64_t num_results = page_results_a_reading + 100;
  const Store store = made(num_results);
  const CampaignDetails part = details_after(num_results, nullptr);
  const CampaignDetails whole = details_after(num_results, &part);
  EXPECT_EQ(whole.num_runs, num_results);
  EXPECT_EQ(details_after(num_results - 1, &whole).num_runs, num_results);
}

TEST_F(DatabaseDetails, AreThoseOfBeforeIfTheFileCannotBeRead) {
  CampaignDetails before;
  {
    Store store = made(3);
    before = details_after(3, nullptr);
    (void)store.rest();
  }
  std::filesystem::rename(file(), directory() / "away.db");
  const CampaignDetails again = details_after(3, &before);
  EXPECT_THAT(again.failure, testing::HasSubstr("(does not exist)"));
  EXPECT_EQ(again.num_runs, 3U);
  EXPECT_EQ(again.html, before.html);
  EXPECT_THAT(texts_of(again), testing::ElementsAre("first", "second"));
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
    return reading.statistics().accuracy[0].worst_run.value;
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
    EXPECT_EQ(reading.statistics().num_runs, num_read);
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
  EXPECT_EQ(reading.statistics().num_runs, 160U);
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

using ReviewedReading = test::ReviewTest;

// A review reads the same results in passes, and its statistics are of another method.
TEST_F(ReviewedReading, ShowsTheTableOfAReview) {
  const Store store = store_with(150);
  ResultsReading reading(store);
  EXPECT_THAT(reading.html(), HasSubstr("nothing to show"));
  reading.read_further(store, 150);
  const std::string html = reading.html();
  EXPECT_EQ(test::malformed_part(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("id=\"accuracy\""), HasSubstr("id=\"errors-title\""),
                          Not(HasSubstr("<html"))));
  const Review review = review_of(store, 150);
  for (const Row& row : accuracy_table(review).rows) {
    for (const Cell& cell : row) {
      EXPECT_THAT(html, HasSubstr(">" + wire::markup_text(cell.in_document()) + "<"));
    }
  }
  EXPECT_THAT(html,
              HasSubstr("50 of 150 completed runs exceed the objective"));  // 101 to 150 % of it.
}

}  // namespace
}  // namespace proofmass::coordinator
