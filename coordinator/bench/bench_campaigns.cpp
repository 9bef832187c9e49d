#include "coordinator/bench/bench_campaigns.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "coordinator/store/store.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/start_program.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

/// A directory that is removed with all that is in it.
class ScratchDirectory {
 public:
  ScratchDirectory() {
    std::error_code failure;
    std::filesystem::path parent = std::filesystem::temp_directory_path(failure);
    if (failure) parent = "/tmp";
    std::string pattern = (parent / "proofmass-bench-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) {
      throw Error(fmt::format("temporary directory = {} (cannot be made: {})", pattern,
                              std::generic_category().message(errno)));
    }
    path_ = pattern;
  }
  ~ScratchDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchDirectory(const ScratchDirectory&) = delete;
  ScratchDirectory& operator=(const ScratchDirectory&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// While it lives, Ctrl-C reaches the campaign alone, which ends; then it ends this process, too,
/// but not before the directory is removed.
class HeldInterrupt {
 public:
  HeldInterrupt() {
    sigset_t interrupt;
    sigemptyset(&interrupt);
    sigaddset(&interrupt, SIGINT);
    pthread_sigmask(SIG_BLOCK, &interrupt, &before_);
  }
  ~HeldInterrupt() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  HeldInterrupt(const HeldInterrupt&) = delete;
  HeldInterrupt& operator=(const HeldInterrupt&) = delete;

 private:
  sigset_t before_{};
};

/// @return True if it ended with code 0.
bool run_to_end(const std::vector<std::string>& arguments) {
  const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
  if (nowhere < 0) {
    throw Error(fmt::format("file = /dev/null (cannot be opened: {})",
                            std::generic_category().message(errno)));
  }
  const pid_t child =
      wire::start_program({.arguments = arguments, .descriptors = {nowhere, nowhere, 2}});
  close(nowhere);
  const int status = wire::wait_for_end(child);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

CampaignCost measure_campaign(std::uint64_t num_runs) {
  const HeldInterrupt held;
  const ScratchDirectory directory;
  const std::filesystem::path file = directory.path() / "bench.toml";
  const std::filesystem::path database = directory.path() / "bench.db";
  wire::write_whole_file("campaign file", file, model().example(), wire::private_mode,
                         wire::IfThere::keep);
  const auto start = std::chrono::steady_clock::now();
  const bool is_done =
      run_to_end({wire::program_beside_this("proofmass").string(), "run", file.string(), "--db",
                  database.string(), "--runs", std::to_string(num_runs), "--quiet"});
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  if (!is_done) throw Error(fmt::format("runs = {} (the campaign failed)", num_runs));
  return {.num_runs = num_runs,
          .wall_s = elapsed.count(),
          .compute_s = Store::open_read_only(database).execution().compute_s};
}

}  // namespace proofmass::coordinator
