#include "worker/spool/spooler.hpp"

#include <gtest/gtest.h>

#include "tests/support/microscope_results.hpp"
#include "tests/worker/temporary_directory.hpp"

namespace proofmass::worker {
namespace {

std::vector<wire::LeasedResult> results(const std::vector<std::uint64_t>& runs) {
  std::vector<wire::LeasedResult> kept;
  for (const std::uint64_t run : runs) {
    kept.push_back({{1}, {1}, {}});
    kept.back().computed.result = test::zero_result({.run = {run}});
  }
  return kept;
}

class SpoolerTest : public testing::Test {
 protected:
  /// The runs whose results the next worker would deliver.
  std::vector<std::uint64_t> stored() {
    spooler.reset();
    spool.reset();
    std::vector<std::uint64_t> runs;
    const Spool next(path, "m");
    for (const wire::LeasedResult& kept : next.former_results()) {
      runs.push_back(kept.computed.result.run.value);
    }
    return runs;
  }
  void open() {
    spool.emplace(path, "m");
    spooler.emplace(*spool);
  }

  TemporaryDirectory directory;
  std::filesystem::path path = directory / "spool";
  std::optional<Spool> spool;
  std::optional<Spooler> spooler;
};

TEST_F(SpoolerTest, WritesWhatHasWaitedFromOneLookToTheNext) {
  open();
  EXPECT_EQ(spooler->look(results({1, 2})), std::nullopt);
  EXPECT_TRUE(spool->is_empty());
  EXPECT_EQ(spooler->look(results({2, 3})), std::nullopt);
  EXPECT_EQ(stored(), std::vector<std::uint64_t>{2});
}

TEST_F(SpoolerTest, WritesEachResultOnce) {
  open();
  for (int i = 0; i < 4; ++i) EXPECT_EQ(spooler->look(results({1, 2})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2}));
}

TEST_F(SpoolerTest, EmptiesTheFileOnceAllIsAcknowledged) {
  open();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(spooler->look(results({1, 2})), std::nullopt);
  EXPECT_EQ(spooler->look({}), std::nullopt);
  EXPECT_TRUE(spool->is_empty());
  for (int i = 0; i < 2; ++i) EXPECT_EQ(spooler->look(results({1})), std::nullopt);
  EXPECT_EQ(stored(), std::vector<std::uint64_t>{1});
}

TEST_F(SpoolerTest, WritesAllThatIsLeftAtTheEnd) {
  open();
  EXPECT_EQ(spooler->look(results({1})), std::nullopt);
  EXPECT_EQ(spooler->finish(results({1, 2})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2}));
}

TEST_F(SpoolerTest, DoesNotWriteWhatItWasHandedAgain) {
  open();
  EXPECT_EQ(spooler->finish(results({1, 2})), std::nullopt);
  spooler.reset();
  spool.reset();
  open();
  EXPECT_EQ(spooler->finish(results({1, 2, 3})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2, 3}));
}

TEST_F(SpoolerTest, TriesAgainWhatItCouldNotWrite) {
  spool.emplace(path, "m", 60);
  spooler.emplace(*spool);
  const std::string expected = "spool = " + path.string() + " (full: must be at most 60 bytes)";
  EXPECT_EQ(spooler->look(results({1})), std::nullopt);
  EXPECT_EQ(spooler->look(results({1})), expected);
  EXPECT_EQ(spooler->finish(results({1})), expected);
}

}  // namespace
}  // namespace proofmass::worker
