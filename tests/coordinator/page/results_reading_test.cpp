#include "coordinator/page/results_reading.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

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
