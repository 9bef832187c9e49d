#include "coordinator/query/query_process.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>
#include <optional>
#include <vector>

#include "coordinator/query/child_process.hpp"
#include "coordinator/store/store_error.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

// A query that can end in order does so within it.
constexpr std::chrono::milliseconds grace(500);
// So often the parent looks whether it is interrupted; a signal wakes it sooner.
constexpr std::chrono::milliseconds look_interval(100);
constexpr std::size_t read_size = std::size_t{64} << 10;

// A process whose address space is limited is to take nothing beside it: temporary files, of which
// a statement may make many, have no limit of their own.
QueryLimits within_limits_of_process(QueryLimits limits) {
  rlimit memory{};
  if (getrlimit(RLIMIT_AS, &memory) != 0 || memory.rlim_cur == RLIM_INFINITY) return limits;
  limits.memory_size_max = std::min<std::uint64_t>(limits.memory_size_max, memory.rlim_cur);
  limits.temporary_data = TemporaryData::in_memory;
  return limits;
}

ChildLimits child_limits(const QueryLimits& limits) {
  // The kernel keeps the limit if the parent is stopped and cannot.
  const double compute_s = std::ceil(limits.time_limit.count()) + 2.0;
  return {.memory_size_max = limits.memory_size_max,
          .compute_s_max = static_cast<std::uint64_t>(compute_s)};
}

/// In the child.
void run_and_tell(const QueryFiles& files, const std::string& sql, const QueryLimits& limits,
                  const QueryOutput& output, int pipe) {
  PartWriter parts(pipe);
  try {
    const auto writer = make_row_writer(output.format, output.table, [&](std::string_view text) {
      parts.add(PartKind::rows, text);
    });
    const QueryEnd end = run_query(files, sql, limits, *writer);
    parts.add(end == QueryEnd::complete ? PartKind::complete : PartKind::interrupted, {});
  } catch (const QueryError& error) {
    parts.add(PartKind::query_error, error.what());
  } catch (const TimeLimitError& error) {
    parts.add(PartKind::time_error, error.what());
  } catch (const StoreError& error) {
    parts.add(PartKind::store_error, error.what());
  } catch (const InvalidArgument& error) {
    parts.add(PartKind::argument_error, error.what());
  } catch (const std::bad_alloc&) {
    parts.add(PartKind::other_error, memory_limit_text(limits));
  } catch (const std::exception& error) {
    parts.add(PartKind::other_error, error.what());
  }
}

/// In the parent: follows the child to its end.
class Follower {
 public:
  Follower(ChildProcess& child, const QueryLimits& limits, const QueryOutput& output)
      : child_(child), limits_(limits), output_(output) {}

  /// @param late_at  When the query should have ended.
  [[nodiscard]] QueryEnd follow(Clock::time_point late_at) {
    kill_at_ = late_at + grace;
    while (!has_ended_) {
      keep_limits(Clock::now());
      if (wait_for_bytes()) {
        read();
      } else {
        output_.flush();
      }
    }
    return verdict(child_.wait());
  }

 private:
  void keep_limits(Clock::time_point now) {
    if (!is_interrupted_ && limits_.is_interrupted()) {
      is_interrupted_ = true;
      kill_at_ = std::min(kill_at_, now + grace);
      child_.signal(SIGTERM);
    }
    if (is_killed_ || now < kill_at_) return;
    is_killed_ = true;
    child_.signal(SIGKILL);
  }

  /// True if there is something to read, or the end.
  [[nodiscard]] bool wait_for_bytes() {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(kill_at_ - Clock::now());
    const auto wait =
        is_killed_ ? look_interval : std::clamp(left, std::chrono::milliseconds(0), look_interval);
    pollfd item{.fd = child_.pipe(), .events = POLLIN, .revents = 0};
    return poll(&item, 1, static_cast<int>(wait.count())) > 0;
  }

  void read() {
    const ssize_t size = ::read(child_.pipe(), bytes_.data(), bytes_.size());
    if (size < 0 && errno == EINTR) return;
    if (size < 0) throw Error(fmt::format("pipe: {}", std::strerror(errno)));
    has_ended_ = size == 0;
    reader_.read({bytes_.data(), static_cast<std::size_t>(size)},
                 [&](PartKind kind, std::string_view text) { take(kind, text); });
  }

  void take(PartKind kind, std::string_view text) {
    if (kind == PartKind::rows) return output_.sink(text);
    told_ = kind;
    text_ = text;
  }

  [[nodiscard]] QueryEnd verdict(int status) const {
    if (!told_) return verdict_of_death(status);
    switch (*told_) {
      case PartKind::complete:
        return QueryEnd::complete;
      case PartKind::interrupted:
        return QueryEnd::interrupted;
      case PartKind::query_error:
        throw QueryError(text_);
      case PartKind::time_error:
        throw TimeLimitError(text_);
      case PartKind::store_error:
        throw StoreError(text_);
      case PartKind::argument_error:
        throw InvalidArgument(text_);
      default:
        throw Error(text_);
    }
  }

  [[nodiscard]] QueryEnd verdict_of_death(int status) const {
    if (is_interrupted_) return QueryEnd::interrupted;
    const bool is_out_of_time = WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU;
    if (is_killed_ || is_out_of_time) throw TimeLimitError(time_limit_text(limits_));
    throw Error(fmt::format("query: its process ended: {}", wire::end_text(status)));
  }

  ChildProcess& child_;
  const QueryLimits& limits_;
  const QueryOutput& output_;
  PartReader reader_;
  std::vector<char> bytes_ = std::vector<char>(read_size);
  Clock::time_point kill_at_;
  bool is_interrupted_ = false;
  bool is_killed_ = false;
  bool has_ended_ = false;
  std::optional<PartKind> told_;
  std::string text_;
};

}  // namespace

QueryEnd run_query_in_process(const QueryFiles& files, const std::string& sql,
                              const QueryLimits& wanted, const QueryOutput& output) {
  const QueryLimits limits = within_limits_of_process(wanted);
  const Clock::time_point late_at =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(limits.time_limit);
  ChildProcess child(child_limits(limits),
                     [&](int pipe) { run_and_tell(files, sql, limits, output, pipe); });
  return Follower(child, limits, output).follow(late_at);
}

}  // namespace proofmass::coordinator
