// What a campaign database of many runs costs: to write, to open, to ask. See README.md.

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/report/report.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/store.hpp"
#include "coordinator/store/store_writer.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/benchmarks/null_result.hpp"
#include "tests/support/microscope_results.hpp"

namespace proofmass::test {
namespace {

using coordinator::Committed;
using coordinator::Store;
using coordinator::StoreWriter;
using coordinator::detail::Access;
using coordinator::detail::Database;
using coordinator::detail::Statement;

constexpr wire::CampaignId id{1};
constexpr wire::SessionId worker{1};
constexpr std::uint64_t num_waiting_max = 20'000;  // As if so many runs were lent.

struct Duration {
  double wall_s = 0.0;
  double processor_s = 0.0;  // Of this process.
};

double processor_time_s() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

Duration duration_of(const std::function<void()>& action) {
  const double processor_before_s = processor_time_s();
  const auto before = std::chrono::steady_clock::now();
  action();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - before;
  return {.wall_s = wall.count(), .processor_s = processor_time_s() - processor_before_s};
}

Duration report(const std::string& what, const std::function<void()>& action) {
  const Duration duration = duration_of(action);
  fmt::print("{:<58}{:9.3f} s{:9.3f} s\n", what, duration.wall_s, duration.processor_s);
  return duration;
}

double peak_memory_mb() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Counts results that are durable.
class Counter {
 public:
  void wake() {
    {
      const std::lock_guard lock(mutex_);
      has_news_ = true;
    }
    woken_.notify_one();
  }

  /// Waits until at most `num_left` of `num_delivered` results are not durable.
  void wait(StoreWriter& writer, std::uint64_t num_delivered, std::uint64_t num_left) {
    while (num_delivered - num_durable_ > num_left) {
      {
        std::unique_lock lock(mutex_);
        woken_.wait(lock, [this] { return std::exchange(has_news_, false); });
      }
      for (const coordinator::Completion& completion : writer.take_completions()) {
        if (const auto* done = std::get_if<Committed>(&completion)) {
          num_durable_ += done->runs.size();
        }
      }
    }
  }

 private:
  std::mutex mutex_;
  std::condition_variable woken_;
  bool has_news_ = false;
  std::uint64_t num_durable_ = 0;
};

void fill(const std::filesystem::path& file, std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.num_runs = num_runs;
  Counter counter;
  StoreWriter writer([&] { counter.wake(); });
  writer.open(id, Store::create(file, campaign, ""));
  writer.write(id, coordinator::WorkerJoined{.session = worker, .name = "null", .host = "here"});
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    writer.write(id, coordinator::Delivery{.result = null_result(campaign.seed, RunIndex{run}),
                                           .worker = worker,
                                           .attempt = {1},
                                           .compute_s = 0.1});
    if (run % 1000 == 0) counter.wait(writer, run + 1, num_waiting_max);
  }
  counter.wait(writer, num_runs, 0);
}

/// All that a coordinator reads before it serves.
void resume(const std::filesystem::path& file) {
  const Store store = Store::open(file);
  if (store.finished_runs().empty()) std::abort();
  (void)store.given_up_runs();
  (void)store.blamed_runs();
  (void)store.attached_sessions();
}

/// Leaves the file as a killed coordinator does.
void serve_and_die(const std::filesystem::path& file) {
  const pid_t child = ::fork();
  if (child == 0) {
    Store store = Store::open(file);
    store.record_event("benchmark", "");
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
}

void ask(const std::filesystem::path& file, const std::string& sql) {
  report(sql, [&] {
    const Database database(file, Access::read_only);
    Statement select = database.prepare(sql);
    select.finish();
  });
}

void ask_views(const std::filesystem::path& file) {
  for (const char* const view : {"parameter_accuracy", "budget", "worst_runs", "campaign_progress",
                                 "worker_throughput", "attempt_history"}) {
    ask(file, fmt::format("SELECT * FROM {}", view));
  }
  for (const char* const view : {"error_long", "overruns"}) {
    ask(file, fmt::format("SELECT count(*) FROM {}", view));
    ask(file, fmt::format("SELECT * FROM {} LIMIT 100", view));
    ask(file, fmt::format("SELECT * FROM {} WHERE run_index = 4711", view));
    ask(file, fmt::format("SELECT * FROM {} WHERE parameter = 'k2c'", view));
    ask(file, fmt::format("SELECT * FROM {}", view));
  }
}

void measure(const std::filesystem::path& file, std::uint64_t num_runs) {
  fmt::print("{:<58}{:>11}{:>11}\n", "", "wall", "processor");
  const Duration filled = report("write all results", [&] { fill(file, num_runs); });
  fmt::print("  results/s committed durably: {:.0f}; peak memory: {:.0f} MB\n",
             static_cast<double>(num_runs) / filled.wall_s, peak_memory_mb());
  report("open and resume after an end in order", [&] { resume(file); });
  serve_and_die(file);
  report("open and resume after being killed", [&] { resume(file); });
  report("open for reading", [&] { Store::open_read_only(file); });
  report("update statistics", [&] {
    Store store = Store::open(file);
    coordinator::update_statistics(store, MicroscopeCampaign{});
  });
  ask_views(file);
  report("check integrity", [&] { Store::open_read_only(file).check_integrity(); });
  report("back up",
         [&] { Store::open_read_only(file).back_up(std::filesystem::path(file).concat(".copy")); });
  fmt::print("file size: {:.0f} MB; peak memory: {:.0f} MB\n",
             static_cast<double>(std::filesystem::file_size(file)) / 1e6, peak_memory_mb());
}

}  // namespace
}  // namespace proofmass::test

int main(int argc, char** argv) {
  CLI::App app("Measures a campaign database of many runs");
  std::uint64_t num_runs = 1'000'000;
  std::string directory = std::filesystem::temp_directory_path();
  app.add_option("--runs", num_runs, "Runs in the file")->capture_default_str();
  app.add_option("--directory", directory, "Where the file is made")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::string own = (std::filesystem::path(directory) / "proofmass_XXXXXX").string();
  if (::mkdtemp(own.data()) == nullptr) {
    fmt::print(stderr, "directory = {} (must be writable)\n", directory);
    return 1;
  }
  proofmass::test::measure(std::filesystem::path(own) / "campaign.db", num_runs);
  std::filesystem::remove_all(own);
  return 0;
}
