// One campaign, computed by processors that are not alike: this machine's and an emulated one,
// which has AVX2 and no AVX-512.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>

#include "coordinator/report/digest.hpp"
#include "coordinator/store/store.hpp"
#include "tests/skip_for_want.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

constexpr const char* emulator = "/usr/bin/qemu-x86_64";

class MixedFleet : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers need addresses that an emulated process does not have";
#endif
    if (!std::filesystem::exists(emulator)) {
      skip_for_want(std::string("no ") + emulator + " (deploy/install-deps.sh installs it)");
      return;
    }
    const std::string text = read_file(path("short.toml"));
    std::ofstream(path("short.toml"))
        << std::regex_replace(text, std::regex("\norbits = [0-9]+"), "\norbits = 1");
  }

  [[nodiscard]] std::string num_runs_of(const std::string& worker) const {
    return stored_text(file_of("hardy2013"),
                       "SELECT count(*) FROM run WHERE worker = '" + worker + "'");
  }
};

// The emulated worker is a hundred times as slow as the other one, which would compute its runs as
// well: the fast one comes when the slow one has delivered.
TEST_F(MixedFleet, HasTheDigestOfOneMachine) {
  Process coordinator = this->coordinator("coordinator", {"short.toml"});
  Process emulated = worker("emulated", {"--no-supervisor"}, {emulator, "-cpu", "Haswell"});
  wait_for_done("hardy2013", 1);
  const auto program = std::filesystem::read_symlink(fmt::format("/proc/{}/exe", emulated.id()));
  EXPECT_EQ(program, std::filesystem::canonical(emulator));
  Process native = worker("native");
  wait_for_done("hardy2013", num_runs);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("coordinator");
  EXPECT_EQ(native.wait(), 0) << errors_of("native");
  EXPECT_EQ(emulated.wait(), 0) << errors_of("emulated");

  const int num_native = std::stoi(num_runs_of("native"));
  const int num_emulated = std::stoi(num_runs_of("emulated"));
  EXPECT_GT(num_native, 0);
  EXPECT_GT(num_emulated, 0);
  EXPECT_EQ(static_cast<std::size_t>(num_native + num_emulated), num_runs);

  ASSERT_EQ(start("alone", {}).wait(), 0) << errors_of("alone");
  const auto alone = proofmass::coordinator::Store::open_read_only(path("alone.db"));
  EXPECT_EQ(digest("hardy2013"), proofmass::coordinator::digest_of(alone));
  EXPECT_EQ(stored_runs(file_of("hardy2013")), stored_runs(path("alone.db")));
}

}  // namespace
}  // namespace proofmass::test
