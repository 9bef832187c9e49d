#include "coordinator/query/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <utility>

#include "core/error.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

bool lower_limit(__rlimit_resource resource, std::uint64_t soft, std::uint64_t hard) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return false;
  limit.rlim_max = std::min<rlim_t>(limit.rlim_max, hard);
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, soft);
  return setrlimit(resource, &limit) == 0;
}

bool apply(const ChildLimits& limits) {
  if (wire::has_address_space_limit &&
      !lower_limit(RLIMIT_AS, limits.memory_size_max, limits.memory_size_max)) {
    return false;
  }
  return lower_limit(RLIMIT_CPU, limits.compute_s_max, limits.compute_s_max + 1);
}

// Without its limits the child does nothing at all.
[[noreturn]] void be_child(pid_t parent, const ChildLimits& limits,
                           const std::function<void(int)>& work, int pipe) {
  const bool dies_with_parent =
      prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && getppid() == parent;  // It may have died before.
  if (!dies_with_parent || !apply(limits)) _exit(127);
  try {
    work(pipe);
  } catch (...) {
    _exit(126);
  }
  _exit(0);
}

constexpr std::size_t buffer_size = std::size_t{64} << 10;
constexpr std::chrono::milliseconds delay_max(20);

/// What comes before the text of a part, of this machine's layout: both ends are one program.
struct Head {
  std::uint32_t kind = 0;
  std::uint32_t size = 0;
};

}  // namespace

ChildProcess::ChildProcess(const ChildLimits& limits, const std::function<void(int)>& work) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Error(fmt::format("pipe: {}", std::strerror(errno)));
  }
  const pid_t parent = getpid();
  id_ = fork();
  if (id_ == 0) {
    close(ends[0]);
    be_child(parent, limits, work, ends[1]);
  }
  const int error = errno;
  close(ends[1]);
  pipe_ = ends[0];
  if (id_ > 0) return;
  close(pipe_);
  throw Error(fmt::format("fork: {}", std::strerror(error)));
}

ChildProcess::~ChildProcess() {
  close(pipe_);
  if (id_ == 0) return;
  kill(id_, SIGKILL);
  (void)wait();
}

void ChildProcess::signal(int number) const {
  if (id_ != 0) kill(id_, number);
}

int ChildProcess::wait() { return wire::wait_for_end(std::exchange(id_, 0)); }

PartWriter::PartWriter(int pipe) : pipe_(pipe), thread_([this] { write_late(); }) {}

PartWriter::~PartWriter() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
  write_all();
}

void PartWriter::add(PartKind kind, std::string_view text) {
  if (text.size() > part_size_max) {
    throw Error(fmt::format("row = {} bytes (must be at most {})", text.size(), part_size_max));
  }
  const Head head{.kind = static_cast<std::uint32_t>(kind),
                  .size = static_cast<std::uint32_t>(text.size())};
  std::array<char, sizeof head> bytes{};
  std::memcpy(bytes.data(), &head, sizeof head);
  const std::lock_guard lock(mutex_);
  const bool is_first = buffer_.empty();
  buffer_.append(bytes.data(), bytes.size()).append(text);
  if (buffer_.size() >= buffer_size) {
    write_all();
  } else if (is_first) {
    changed_.notify_one();
  }
}

void PartWriter::write_late() {
  std::unique_lock lock(mutex_);
  while (!is_ending_) {
    changed_.wait(lock, [&] { return is_ending_ || !buffer_.empty(); });
    changed_.wait_for(lock, delay_max, [&] { return is_ending_; });
    write_all();
  }
}

// A parent that is gone has taken this process with it.
void PartWriter::write_all() {
  std::string_view left = buffer_;
  while (!left.empty()) {
    const ssize_t size = write(pipe_, left.data(), left.size());
    if (size < 0 && errno != EINTR) break;
    if (size > 0) left.remove_prefix(static_cast<std::size_t>(size));
  }
  buffer_.clear();
}

void PartReader::read(std::string_view bytes, const Visit& visit) {
  buffer_ += bytes;
  std::string_view left = buffer_;
  Head head;
  while (left.size() >= sizeof head) {
    std::memcpy(&head, left.data(), sizeof head);
    const bool is_known = head.kind >= static_cast<std::uint32_t>(PartKind::rows) &&
                          head.kind <= static_cast<std::uint32_t>(PartKind::other_error);
    if (!is_known || head.size > part_size_max) {
      throw Error("query: its process does not keep to the format of its answer");
    }
    if (left.size() - sizeof head < head.size) break;
    visit(static_cast<PartKind>(head.kind), left.substr(sizeof head, head.size));
    left.remove_prefix(sizeof head + head.size);
  }
  buffer_.erase(0, buffer_.size() - left.size());
}

}  // namespace proofmass::coordinator
