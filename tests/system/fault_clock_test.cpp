// Clocks that jump by a year, as where nobody had set them. It takes libfaketime: without it the
// test is skipped, but fails in CI.

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

/// The library for programs with threads; empty if it is not installed.
std::string faketime_library() {
  for (const auto& folder : std::filesystem::directory_iterator("/usr/lib")) {
    const auto library = folder.path() / "faketime" / "libfaketimeMT.so.1";
    if (std::filesystem::exists(library)) return library;
  }
  return {};
}

class ClockJump : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    set_clock("+0");
    if (faketime_library().empty()) skip_for_want("libfaketime is not installed");
  }

  /// How far the clocks of all programs behind clock() are from the right time.
  void set_clock(const std::string& difference) const {
    std::ofstream(path("clock.new")) << difference << "\n";
    std::filesystem::rename(path("clock.new"), path("clock"));
  }
  [[nodiscard]] Arguments clock() const {
    return {"LD_PRELOAD=" + faketime_library(), "FAKETIME_TIMESTAMP_FILE=" + path("clock").string(),
            "FAKETIME_NO_CACHE=1", "FAKETIME_DONT_FAKE_MONOTONIC=1"};
  }
};

// The campaign is extended after each jump: however late that comes, there are runs after it.
TEST_F(ClockJump, ChangesNothingButTheTimesThatAreWritten) {
  write_null_campaign(1500);
  Process coordinator = this->coordinator("coordinator", {"null.toml"}, clock());
  const Process one = null_worker("one", {}, clock());
  const Process two = null_worker("two", {}, clock());
  wait_for_done("null", 500);
  set_clock("+365d");
  extend_null_campaign(3000);
  wait_for_done("null", 2000);
  set_clock("-365d");
  extend_null_campaign(4500);
  wait_for_done("null", 4500);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  const auto file = file_of("null");
  // Between the last delivery before the second jump and the first after it time went on.
  EXPECT_EQ(stored_text(file,
                        "SELECT CAST(round((max(received_unix_s) - min(received_unix_s)) / "
                        "(86400 * 365.0)) AS INTEGER) FROM delivery"),
            "2");
  EXPECT_EQ(stored_text(file, "SELECT count(*) FROM attempt WHERE reason <> 'retracted'"), "0");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
