#pragma once

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

/// Harmonic environment, no tables.
inline MicroscopeCampaign campaign_of(std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  return campaign;
}

/// Changes a file as anybody with SQL can.
inline void change(const std::filesystem::path& file, const std::string& sql) {
  coordinator::detail::Database database(file, coordinator::detail::Access::read_write);
  database.execute(sql);
}

/// First cell of a query of a file, without opening it as a Store.
inline std::string text_in(const std::filesystem::path& file, const std::string& sql) {
  return coordinator::detail::Database(file, coordinator::detail::Access::read_only).text(sql);
}

/// A test with a directory of its own, removed afterwards.
class StoreTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path directory() const { return directory_.path(); }
  [[nodiscard]] std::filesystem::path file() const { return directory_ / "campaign.db"; }

  [[nodiscard]] std::set<std::string> file_names() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(directory())) {
      names.insert(entry.path().filename());
    }
    return names;
  }

  coordinator::Store create(std::uint64_t num_runs = 10) const {
    return coordinator::Store::create(file(), campaign_of(num_runs), "");
  }
  void change(const std::string& sql) const { test::change(file(), sql); }
  [[nodiscard]] std::string text(const std::string& sql) const { return text_in(file(), sql); }
  [[nodiscard]] std::int64_t integer(const std::string& sql) const {
    return coordinator::detail::Database(file(), coordinator::detail::Access::read_only)
        .integer(sql);
  }
  /// `campaign database = <file()> (<reason>)`
  [[nodiscard]] std::string message(const std::string& reason) const {
    return "campaign database = " + file().string() + " (" + reason + ")";
  }

 private:
  ScratchDirectory directory_;
};

inline void write_file(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

inline std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A result whose every number depends on the run; 1/3 needs all bits of a double.
inline RunResult result_of(std::uint64_t run, RunStatus status = RunStatus::completed) {
  RunResult result =
      zero_result({.run = RunIndex{run}, .status = status, .num_draws = 2, .num_rounds = 3});
  for (std::size_t i = 0; i < result.truth.size(); ++i) {
    result.truth[i] = (static_cast<double>(run) + 1.0) / 3.0 * std::pow(10.0, -double(i));
  }
  for (std::size_t i = 0; i < result.estimate.size(); ++i) {
    result.estimate[i] = result.truth[i] * (1.0 + 1e-3);
  }
  return result;
}

/// The worker of all deliveries here.
inline constexpr wire::SessionId session_1{0xfedcba9876543210};

inline coordinator::WorkerJoined worker_1() {
  return {.session = session_1,
          .name = "worker-1",
          .host = "node-1",
          .process_id = 4711,
          .num_slots = 8};
}

inline coordinator::Delivery delivery_of(std::uint64_t run) {
  return {.result = result_of(run), .worker = session_1, .attempt = {1}, .compute_s = 0.5};
}

/// A result of the run that no sound worker computes: one estimate is off by the last bit.
inline coordinator::Delivery wrong_delivery_of(std::uint64_t run) {
  coordinator::Delivery delivery = delivery_of(run);
  double& estimate = delivery.result.estimate[9];
  estimate = std::nextafter(estimate, 1e300);
  return delivery;
}

/// Runs that worker_1() lost at their first attempt.
inline coordinator::ReturnedRuns lost_runs(std::uint64_t first, std::uint64_t count,
                                           wire::LossReason reason, bool is_blamed) {
  return {.runs = {{first}, count},
          .attempt = {1},
          .worker = session_1,
          .reason = reason,
          .is_blamed = is_blamed};
}

inline std::vector<coordinator::Delivery> deliveries_of(std::uint64_t first, std::uint64_t end) {
  std::vector<coordinator::Delivery> deliveries;
  for (std::uint64_t run = first; run < end; ++run) deliveries.push_back(delivery_of(run));
  return deliveries;
}

/// Kinds of its events, in order: `log_lost,resumed`.
inline std::string event_kinds_in(const std::filesystem::path& file) {
  return text_in(file, "SELECT group_concat(kind) FROM (SELECT kind FROM event ORDER BY event_id)");
}

inline std::vector<RunResult> results_in(const coordinator::Store& store) {
  std::vector<RunResult> results;
  store.for_each_result([&](const RunResult& result) { results.push_back(result); });
  return results;
}

inline std::vector<coordinator::Comparison> write(coordinator::Store& store,
                                                  const std::vector<coordinator::Entry>& entries) {
  return store.write(entries);
}

/// Second results that were not the stored ones.
inline auto num_contradicting(const std::vector<coordinator::Comparison>& comparisons) {
  return std::ranges::count(comparisons, false, &coordinator::Comparison::is_equal);
}

/// Text of the StoreError that `action` throws; empty if it throws none.
inline std::string store_error_of(const std::function<void()>& action) {
  return message_of<coordinator::StoreError>(action);
}

/// While it lives, the process has no more rights than an ordinary user: root may write anywhere.
class OrdinaryUser {
 public:
  OrdinaryUser() {
    if (::geteuid() == 0 && ::seteuid(65534) != 0) throw std::runtime_error("seteuid failed");
  }
  ~OrdinaryUser() {
    if (::getuid() == 0 && ::seteuid(0) != 0) std::abort();
  }
  OrdinaryUser(const OrdinaryUser&) = delete;
  OrdinaryUser& operator=(const OrdinaryUser&) = delete;
};

/// Runs `action` in a child process that is killed at its end without any clean-up.
inline void run_and_kill(const std::function<void()>& action) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    action();
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_EQ(WTERMSIG(status), SIGKILL);
}

/// While it lives, no file can grow beyond a size: to a program, much like a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t size) {
    ::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = size, .rlim_max = before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, SIG_DFL);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

}  // namespace proofmass::test

namespace proofmass::coordinator {
using test::campaign_of;
using test::deliveries_of;
using test::delivery_of;
using test::results_in;
using test::store_error_of;
using test::wrong_delivery_of;
}  // namespace proofmass::coordinator
