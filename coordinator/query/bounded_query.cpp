#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <exception>
#include <mutex>
#include <new>
#include <thread>

#include "coordinator/query/query.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

// A query that can end in order does so within it.
constexpr std::chrono::milliseconds grace(500);
// Rows wait for others no longer than this.
constexpr std::chrono::milliseconds delay_max(20);
constexpr std::size_t buffer_size = std::size_t{64} << 10;

/// Takes from this process what the query must not have.
/// @return The limits that hold. A process whose address space was limited before is to take
///         nothing beside it: temporary files, of which a statement may make many, have no limit of
///         their own.
QueryLimits limit_process(QueryLimits limits) {
  if (!wire::has_address_space_limit) return limits;
  rlimit memory{};
  if (getrlimit(RLIMIT_AS, &memory) == 0 && memory.rlim_cur != RLIM_INFINITY) {
    limits.memory_size_max = std::min<std::uint64_t>(limits.memory_size_max, memory.rlim_cur);
    limits.temporary_data = TemporaryData::in_memory;
  }
  const rlim_t size = std::min<rlim_t>(limits.memory_size_max, memory.rlim_max);
  memory = {.rlim_cur = size, .rlim_max = size};
  if (setrlimit(RLIMIT_AS, &memory) == 0) return limits;
  throw Error(fmt::format("memory: cannot be limited: {}", std::strerror(errno)));
}

/// Hands rows on while the query runs, and ends the process if the query does not end.
class Watch {
 public:
  Watch(const QueryLimits& limits, const QueryOutput& output)
      : limits_(limits),
        output_(output),
        end_at_(Clock::now() + std::chrono::duration_cast<Clock::duration>(limits.time_limit) +
                grace),
        thread_([this] { watch(); }) {}
  ~Watch() {
    {
      const std::lock_guard lock(mutex_);
      is_ending_ = true;
    }
    changed_.notify_one();
    thread_.join();
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  /// Hands on all rows once there are so many bytes of them.
  void add(std::string_view rows, std::size_t size_min = buffer_size) {
    const std::lock_guard lock(mutex_);
    rows_ += rows;
    if (rows_.size() >= size_min) hand_on();
    if (failure_) std::rethrow_exception(failure_);
  }
  void finish() { add({}, 0); }

 private:
  void watch() {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, delay_max, [this] { return is_ending_; })) {
      hand_on();
      const Clock::time_point now = Clock::now();
      if (!is_interrupted_ && limits_.is_interrupted()) {
        is_interrupted_ = true;
        end_at_ = std::min(end_at_, now + grace);
      }
      if (now >= end_at_) output_.end_process(is_interrupted_ ? "" : time_limit_text(limits_));
    }
  }

  void hand_on() {
    try {
      if (!rows_.empty() && !failure_) output_.sink(rows_);
    } catch (const std::exception&) {
      failure_ = std::current_exception();
    }
    rows_.clear();
  }

  const QueryLimits& limits_;
  const QueryOutput& output_;
  std::mutex mutex_;  ///< Guards what follows.
  std::condition_variable changed_;
  Clock::time_point end_at_;
  std::string rows_;
  std::exception_ptr failure_;  ///< Of the sink.
  bool is_interrupted_ = false;
  bool is_ending_ = false;
  std::thread thread_;  ///< Begins when all else is there.
};

}  // namespace

QueryEnd run_bounded_query(const QueryFiles& files, const std::string& sql,
                           const QueryLimits& wanted, const QueryOutput& output) {
  const QueryLimits limits = limit_process(wanted);
  Watch watch(limits, output);
  const auto hand_on = [&](std::string_view rows) { watch.add(rows); };
  try {
    const auto writer = make_row_writer(output.format, output.table, hand_on);
    const QueryEnd end = run_query(files, sql, limits, *writer);
    watch.finish();
    return end;
  } catch (const std::bad_alloc&) {
    watch.finish();
    throw Error(memory_limit_text(limits));
  } catch (const std::exception&) {
    watch.finish();
    throw;
  }
}

}  // namespace proofmass::coordinator
