// A disk that changes bits: whatever is read from a campaign database is what was stored, or is
// refused.

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/report.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

std::size_t number_at(const std::string& bytes, std::size_t at, std::size_t size) {
  std::size_t number = 0;
  for (std::size_t i = 0; i < size; ++i) {
    number = number << 8 | static_cast<unsigned char>(bytes.at(at + i));
  }
  return number;
}

/// Makes two rows of a small table, numbered below 128 by their key and all on one page, change
/// their keys, as bits that flip on a disk may: their order is not that of the tree any more.
void swap_keys(const std::filesystem::path& file, const std::string& table, unsigned a,
               unsigned b) {
  const auto page = static_cast<std::size_t>(
      detail::Database(file, detail::Access::read_only)
          .integer("SELECT rootpage FROM sqlite_schema WHERE name = '" + table + "'"));
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t start = (page - 1) * number_at(bytes, 16, 2);
  constexpr char table_leaf = 13;
  if (bytes.at(start) != table_leaf) throw std::runtime_error("the table has several pages");
  std::vector<std::size_t> keys;  // Where the keys a and b stand.
  for (std::size_t cell = 0; cell < number_at(bytes, start + 3, 2); ++cell) {
    std::size_t at = start + number_at(bytes, start + 8 + 2 * cell, 2);
    while ((bytes.at(at) & 0x80) != 0) ++at;  // The size of the row.
    ++at;
    const auto key = static_cast<unsigned char>(bytes.at(at));
    if (key == a || key == b) keys.push_back(at);
  }
  if (keys.size() != 2) throw std::runtime_error("the rows are not there");
  std::swap(bytes[keys[0]], bytes[keys[1]]);
  std::ofstream(file, std::ios::binary) << bytes;
}

constexpr const char* refused = "refused";

class BitFlips : public test::StoreTest {
 protected:
  /// A campaign that has ended by a rule, with a run that was given up and one of each status.
  void SetUp() override {
    std::vector<RunResult> results = test::results_of_each_status(20);
    results.pop_back();
    Store store = test::store_of(file(), test::campaign_of(20), results);
    const std::vector<Entry> entries{ReturnedRuns{.runs = {RunIndex{19}, 1},
                                                  .attempt = {1},
                                                  .worker = test::session_1,
                                                  .reason = wire::LossReason::crashed,
                                                  .is_blamed = true},
                                     GivenUpRun{.run = RunIndex{19}}};
    (void)store.write(entries);
    store.set_stop_plan(
        {.stop_rule = "mean(k2c) within 90%", .num_runs_max = 20, .failures_max = {}});
    (void)summarise_file(file(), MicroscopeCampaign{},
                         [&](const std::function<void(Store&)>& action) { action(store); });
    const Entry finished = CampaignControl{.phase = wire::CampaignPhase::finished};
    (void)store.write({&finished, 1});
  }

  /// What a command prints of a file, or that it refuses it.
  template <typename Print>
  static std::string printed(const Print& print) {
    try {
      return print();
    } catch (const Error&) {
      return refused;
    }
  }

  [[nodiscard]] std::string report_of(const std::filesystem::path& path) const {
    return printed([&] {
      const Store store = Store::open_read_only(path);
      return report_text(read_review(store, *stored_campaign(store), ReviewDepth::matrix));
    });
  }

  [[nodiscard]] std::string export_of(const std::filesystem::path& path) const {
    return printed([&] {
      const Store store = Store::open_read_only(path);
      export_hdf5(store, directory() / "export", test::never_stopped);
      return test::content_of(directory() / "export");
    });
  }

  [[nodiscard]] std::string comparison_of(const std::filesystem::path& path) const {
    return printed([&] {
      const std::vector<std::filesystem::path> files{path, file()};
      std::vector<ComparedCampaign> members = compare_several(files, test::never_stopped);
      members.front().file = file();
      return comparison_json(members).dump(2);
    });
  }

  /// Calls check(file, what) with `count` copies of the file, each of them with another bit
  /// changed.
  template <typename Check>
  void for_each_flip(std::uint64_t seed, int count, const Check& check) {
    const std::string bytes = test::content_of(file());
    const std::filesystem::path damaged = directory() / "damaged.db";
    std::mt19937_64 random(seed);
    for (int i = 0; i < count; ++i) {
      const std::uint64_t bit = random() % (8 * bytes.size());
      std::string flipped = bytes;
      flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << (bit % 8)));
      test::write_file(damaged, flipped);
      check(damaged, "bit " + std::to_string(bit % 8) + " of byte " + std::to_string(bit / 8));
    }
  }

  template <typename Print>
  void expect_what_was_stored_or_refused(std::uint64_t seed, int count, const Print& print) {
    const std::string expected = print(file());
    ASSERT_NE(expected, refused);
    int num_refused = 0;
    for_each_flip(seed, count, [&](const std::filesystem::path& path, const std::string& what) {
      const std::string text = print(path);
      if (text == refused) {
        ++num_refused;
      } else {
        EXPECT_EQ(text, expected) << what;
      }
    });
    EXPECT_GT(num_refused, count / 20) << "nothing is looked at";
  }
};

TEST_F(BitFlips, LeaveAReportAsItIsOrMakeItRefused) {
  expect_what_was_stored_or_refused(
      1, 250, [&](const std::filesystem::path& path) { return report_of(path); });
}

TEST_F(BitFlips, LeaveExportsAsTheyAreOrMakeThemRefused) {
  expect_what_was_stored_or_refused(
      2, 150, [&](const std::filesystem::path& path) { return export_of(path); });
}

TEST_F(BitFlips, LeaveAComparisonAsItIsOrMakeItRefused) {
  expect_what_was_stored_or_refused(
      4, 75, [&](const std::filesystem::path& path) { return comparison_of(path); });
}

// Nothing but an Error comes out, and nothing aborts.
TEST_F(BitFlips, EndNoVerificationAndNoListing) {
  for_each_flip(5, 100, [&](const std::filesystem::path& path, const std::string& what) {
    (void)printed([&] {
      std::size_t num_failing = 0;
      verify(
          path, {.model_version = "another, so that nothing is simulated"},
          [&](const Check& check) { num_failing += check.verdict == CheckOutcome::fails ? 1 : 0; },
          test::never_stopped);
      EXPECT_GT(num_failing, 0U) << what;
      return std::string();
    });
    (void)printed([&] { return terminal_text(listing_table(list_campaigns(std::vector{path}))); });
  });
}

/// Two rows of a table whose keys changed places.
class RowsOutOfOrder : public BitFlips {
 protected:
  void expect_refusal(const std::string& reason) {
    const auto message = [&](const auto& action) { return test::error_of(action); };
    const Store store = Store::open_read_only(file());
    const std::string expected = "campaign database = " + file().string() +
                                 " (is damaged: " + reason + "; restore it from a copy)";
    EXPECT_EQ(message([&] { (void)read_review(store, MicroscopeCampaign{}, ReviewDepth::matrix); }),
              expected);
    EXPECT_EQ(message([&] { (void)read_results(store, MicroscopeCampaign{}); }), expected);
    EXPECT_EQ(message([&] { export_hdf5(store, directory() / "export", test::never_stopped); }),
              expected);
    EXPECT_EQ(message([&] {
                (void)summarise_file(file(), MicroscopeCampaign{},
                                     [](const std::function<void(Store&)>&) {});
              }),
              expected);
  }
};

TEST_F(RowsOutOfOrder, OfResultsAreRefused) {
  // A file of one page of results.
  std::filesystem::remove(file());
  (void)test::store_of(file(), test::campaign_of(9), test::results_of_each_status(9));
  swap_keys(file(), "run_result", 5, 2);
  expect_refusal("result of run 3 comes after that of run 5");
  std::string results;
  verify(
      file(), {},
      [&](const Check& check) {
        if (check.name == "results") results = check.finding;
      },
      test::never_stopped);
  EXPECT_NE(results.find("is damaged: result of run 3 comes after that of run 5"),
            std::string::npos)
      << results;
}

TEST_F(RowsOutOfOrder, OfDeliveriesAreRefused) {
  swap_keys(file(), "delivery", 5, 12);
  const Store store = Store::open_read_only(file());
  EXPECT_EQ(test::error_of([&] { (void)store.finished_runs(); }),
            "campaign database = " + file().string() +
                " (is damaged: run 6 comes after run 12; restore it from a copy)");
}

TEST_F(RowsOutOfOrder, OfGivenUpRunsThatHaveResultsAreRefused) {
  test::change(file(), "UPDATE run_failure SET run_index = 3");
  EXPECT_EQ(report_of(file()), refused);
}

}  // namespace
}  // namespace proofmass::coordinator
