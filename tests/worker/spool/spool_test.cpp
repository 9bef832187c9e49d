#include "worker/spool/spool.hpp"

#include <sys/resource.h>

#include <csignal>

#include "core/error.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::worker {
namespace {

wire::LeasedResult result(std::uint64_t run, std::uint64_t campaign = 1,
                          std::uint32_t attempt = 1) {
  wire::LeasedResult kept{{campaign}, {attempt}, {}};
  kept.computed.result = test::zero_result({.run = {run}});
  kept.computed.result.truth[3] = 0.1 * static_cast<double>(run);
  kept.computed.compute_s = 1.5;
  kept.computed.elapsed_s = 24.0;
  return kept;
}

std::vector<std::uint64_t> runs_of(const std::vector<wire::LeasedResult>& results) {
  std::vector<std::uint64_t> runs;
  for (const wire::LeasedResult& kept : results) runs.push_back(kept.computed.result.run.value);
  return runs;
}

class SpoolTest : public testing::Test {
 protected:
  /// What the file holds, as the next worker sees it.
  std::vector<std::uint64_t> stored_runs() const {
    return runs_of(Spool(path, "model").former_results());
  }
  void store(const std::vector<wire::LeasedResult>& results) const {
    ASSERT_EQ(Spool(path, "model").finish(results), std::nullopt);
  }
  std::string content() const {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  void replace_content(const std::string& text) const {
    std::ofstream(path, std::ios::binary) << text;
  }
  std::string error_of_opening(const std::string& model = "model",
                               std::uint64_t size_max = 1 << 20) const {
    try {
      const Spool spool(path, model, size_max);
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  }

  test::ScratchDirectory directory;
  std::filesystem::path path = directory / "spool";
};

TEST_F(SpoolTest, HandsResultsToTheNextWorker) {
  store({result(7, 1, 2), result(8, 1, 2), result(7, 2)});
  const Spool spool(path, "model");
  ASSERT_EQ(runs_of(spool.former_results()), (std::vector<std::uint64_t>{7, 8, 7}));
  const wire::LeasedResult& kept = spool.former_results()[1];
  EXPECT_EQ(kept.campaign, wire::CampaignId{1});
  EXPECT_EQ(kept.attempt, wire::Attempt{2});
  EXPECT_EQ(std::bit_cast<std::uint64_t>(kept.computed.result.truth[3]),
            std::bit_cast<std::uint64_t>(0.1 * 8.0));
  EXPECT_EQ(kept.computed.compute_s, 1.5);
  EXPECT_EQ(kept.computed.elapsed_s, 24.0);
  EXPECT_EQ(spool.num_bytes_dropped(), 0U);
}

TEST_F(SpoolTest, AddsToWhatIsThere) {
  store({result(1)});
  store({result(2)});
  EXPECT_EQ(stored_runs(), (std::vector<std::uint64_t>{1, 2}));
}

// More than one message has room for.
TEST_F(SpoolTest, TakesManyResults) {
  std::vector<wire::LeasedResult> results;
  for (std::uint64_t run = 0; run < 5000; ++run) results.push_back(result(run));
  store(results);
  const std::vector<std::uint64_t> runs = stored_runs();
  ASSERT_EQ(runs.size(), 5000U);
  EXPECT_EQ(runs.back(), 4999U);
}

TEST_F(SpoolTest, LeavesNoFileBehindIfItHoldsNothing) {
  { const Spool spool(path, "model"); }
  EXPECT_FALSE(std::filesystem::exists(path));
  {
    Spool spool(path, "model");
    EXPECT_EQ(spool.finish({result(1)}), std::nullopt);
    EXPECT_FALSE(spool.is_empty());
    EXPECT_EQ(spool.look({}), std::nullopt);
    EXPECT_TRUE(spool.is_empty());
    EXPECT_EQ(std::filesystem::file_size(path), spool.size());
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

// A process may die at any byte: of the two records, every cut leaves the first, or none.
TEST_F(SpoolTest, DropsARecordThatWasNotWrittenToItsEnd) {
  store({result(1)});
  const std::size_t size_of_one = content().size();
  store({result(2)});
  const std::string whole = content();
  const std::size_t header = whole.find('\n') + 1;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    replace_content(whole.substr(0, size));
    const Spool spool(path, "model");
    const std::size_t num_expected = size >= size_of_one ? 1 : 0;
    EXPECT_EQ(spool.former_results().size(), num_expected) << size;
    const std::size_t good = size >= size_of_one ? size_of_one : (size >= header ? header : 0);
    EXPECT_EQ(spool.num_bytes_dropped(), size - good) << size;
  }
  store({result(3)});
  EXPECT_EQ(stored_runs(), (std::vector<std::uint64_t>{1, 3})) << "new ones follow the good ones";
}

TEST_F(SpoolTest, DropsWhatAFlippedBitHasSpoilt) {
  store({result(1)});
  const std::size_t size_of_one = content().size();
  store({result(2)});
  const std::string whole = content();
  for (std::size_t i = size_of_one; i < whole.size(); ++i) {
    std::string spoilt = whole;
    spoilt[i] = static_cast<char>(spoilt[i] ^ 0x10);
    replace_content(spoilt);
    const Spool spool(path, "model");
    EXPECT_EQ(runs_of(spool.former_results()), std::vector<std::uint64_t>{1}) << i;
    EXPECT_EQ(spool.num_bytes_dropped(), whole.size() - size_of_one);
    EXPECT_EQ(std::filesystem::file_size(path), size_of_one);
  }
}

TEST_F(SpoolTest, BelongsToOneWorker) {
  const Spool first(path, "model");
  EXPECT_EQ(error_of_opening(), "spool = " + path.string() + " (used by another worker)");
}

TEST_F(SpoolTest, SetsResultsOfAnotherModelAside) {
  store({result(1)});
  const std::string before = content();
  {
    Spool spool(path, "model-2");
    EXPECT_TRUE(spool.former_results().empty());
    EXPECT_EQ(spool.former_spool(), path.string() + ".model");
    EXPECT_EQ(spool.finish({result(2)}), std::nullopt);
  }
  EXPECT_EQ(runs_of(Spool(path, "model-2").former_results()), std::vector<std::uint64_t>{2});
  std::filesystem::rename(path.string() + ".model", path);
  EXPECT_EQ(content(), before);
}

TEST_F(SpoolTest, OverwritesNothingWhenItSetsAside) {
  store({result(1)});
  std::ofstream(path.string() + ".model") << "kept";
  EXPECT_EQ(error_of_opening("model-2"), "spool = " + path.string() +
                                             " (of the model model; cannot become " +
                                             path.string() + ".model: File exists)");
  EXPECT_EQ(stored_runs(), std::vector<std::uint64_t>{1}) << "it is as it was";
}

TEST_F(SpoolTest, LeavesOtherFilesAlone) {
  replace_content("something that is no spool, and longer than its first line");
  EXPECT_EQ(error_of_opening(), "spool = " + path.string() + " (must be a spool, or not exist)");
  EXPECT_TRUE(content().starts_with("something"));
}

TEST_F(SpoolTest, RefusesAFileThatIsTooLarge) {
  store({result(1), result(2)});
  EXPECT_EQ(error_of_opening("model", 100),
            "spool = " + path.string() + " (must be at most 100 bytes)");
}

TEST_F(SpoolTest, StaysWithinItsSize) {
  Spool spool(path, "model", 400);
  ASSERT_EQ(spool.finish({result(1)}), std::nullopt);
  const std::uint64_t size = spool.size();
  EXPECT_EQ(spool.finish({result(2), result(3)}),
            "spool = " + path.string() + " (full: must be at most 400 bytes)");
  EXPECT_EQ(spool.size(), size);
}

/// No file grows beyond this size for as long as it lives, as on a disk that is full.
class DiskLimit {
 public:
  explicit DiskLimit(rlim_t size) : former_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &former_);
    const rlimit limit{.rlim_cur = size, .rlim_max = former_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~DiskLimit() {
    setrlimit(RLIMIT_FSIZE, &former_);
    std::signal(SIGXFSZ, former_handler_);
  }
  DiskLimit(const DiskLimit&) = delete;
  DiskLimit& operator=(const DiskLimit&) = delete;

 private:
  rlimit former_{};
  void (*former_handler_)(int);
};

// The second record is written in part, and taken back.
TEST_F(SpoolTest, IsAsBeforeIfTheDiskIsFull) {
  Spool spool(path, "model");
  ASSERT_EQ(spool.finish({result(1)}), std::nullopt);
  {
    const DiskLimit limit(spool.size() + 20);
    EXPECT_EQ(spool.finish({result(2)}), "spool = " + path.string() + " (File too large)");
  }
  EXPECT_EQ(std::filesystem::file_size(path), spool.size());
  EXPECT_EQ(spool.finish({result(3)}), std::nullopt);
}

TEST_F(SpoolTest, SaysThatItCannotBeMadeOnAFullDisk) {
  const DiskLimit limit(5);
  EXPECT_EQ(error_of_opening(), "spool = " + path.string() + " (File too large)");
}

std::vector<wire::LeasedResult> results(const std::vector<std::uint64_t>& runs) {
  std::vector<wire::LeasedResult> kept;
  for (const std::uint64_t run : runs) {
    kept.push_back({{1}, {1}, {}});
    kept.back().computed.result = test::zero_result({.run = {run}});
  }
  return kept;
}

class SpoolLookTest : public testing::Test {
 protected:
  /// The runs whose results the next worker would deliver.
  std::vector<std::uint64_t> stored() {
    spool.reset();
    std::vector<std::uint64_t> runs;
    const Spool next(path, "m");
    for (const wire::LeasedResult& kept : next.former_results()) {
      runs.push_back(kept.computed.result.run.value);
    }
    return runs;
  }
  void open() { spool.emplace(path, "m"); }

  test::ScratchDirectory directory;
  std::filesystem::path path = directory / "spool";
  std::optional<Spool> spool;
};

TEST_F(SpoolLookTest, WritesWhatHasWaitedFromOneLookToTheNext) {
  open();
  EXPECT_EQ(spool->look(results({1, 2})), std::nullopt);
  EXPECT_TRUE(spool->is_empty());
  EXPECT_EQ(spool->look(results({2, 3})), std::nullopt);
  EXPECT_EQ(stored(), std::vector<std::uint64_t>{2});
}

TEST_F(SpoolLookTest, WritesEachResultOnce) {
  open();
  for (int i = 0; i < 4; ++i) EXPECT_EQ(spool->look(results({1, 2})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2}));
}

TEST_F(SpoolLookTest, EmptiesTheFileOnceAllIsAcknowledged) {
  open();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(spool->look(results({1, 2})), std::nullopt);
  EXPECT_EQ(spool->look({}), std::nullopt);
  EXPECT_TRUE(spool->is_empty());
  for (int i = 0; i < 2; ++i) EXPECT_EQ(spool->look(results({1})), std::nullopt);
  EXPECT_EQ(stored(), std::vector<std::uint64_t>{1});
}

TEST_F(SpoolLookTest, WritesAllThatIsLeftAtTheEnd) {
  open();
  EXPECT_EQ(spool->look(results({1})), std::nullopt);
  EXPECT_EQ(spool->finish(results({1, 2})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2}));
}

TEST_F(SpoolLookTest, DoesNotWriteWhatItWasHandedAgain) {
  open();
  EXPECT_EQ(spool->finish(results({1, 2})), std::nullopt);
  spool.reset();
  open();
  EXPECT_EQ(spool->finish(results({1, 2, 3})), std::nullopt);
  EXPECT_EQ(stored(), (std::vector<std::uint64_t>{1, 2, 3}));
}

TEST_F(SpoolLookTest, TriesAgainWhatItCouldNotWrite) {
  spool.emplace(path, "m", 60);
  const std::string expected = "spool = " + path.string() + " (full: must be at most 60 bytes)";
  EXPECT_EQ(spool->look(results({1})), std::nullopt);
  EXPECT_EQ(spool->look(results({1})), expected);
  EXPECT_EQ(spool->finish(results({1})), expected);
}

}  // namespace

}  // namespace proofmass::worker
