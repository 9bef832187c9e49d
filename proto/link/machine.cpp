#include "proto/link/machine.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <sstream>
#include <string>

#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

constexpr int status_if_unknown = W_EXITCODE(1, 0);

std::string text_of(const char* file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

double quota_of_group(const std::filesystem::path& group) {
  double quota_us = 0.0, period_us = 0.0;  // The file has `max` for no quota.
  std::ifstream(group / "cpu.max") >> quota_us >> period_us;
  const bool has_quota = quota_us > 0.0 && period_us > 0.0;
  return has_quota ? quota_us / period_us : std::numeric_limits<double>::infinity();
}

}  // namespace

unsigned num_processors() {
  // More than any kernel has; a mask that is too small for the kernel's is an error.
  constexpr int count_max = 1 << 16;
  const std::unique_ptr<cpu_set_t, void (*)(cpu_set_t*)> mask(
      CPU_ALLOC(count_max), [](cpu_set_t* set) { CPU_FREE(set); });
  const std::size_t size = CPU_ALLOC_SIZE(count_max);
  const bool is_known = sched_getaffinity(0, size, mask.get()) == 0;
  const double count = is_known ? CPU_COUNT_S(size, mask.get()) : 1;
  const double quota = processor_quota(text_of("/proc/self/cgroup"), "/sys/fs/cgroup");
  return static_cast<unsigned>(std::max(1.0, std::min(count, std::ceil(quota))));
}

// The group is on a line `0::/a/b`. In a container, where the path may be that of the host, the
// uppermost group is the container's own.
double processor_quota(std::string_view memberships, const std::filesystem::path& root) {
  constexpr std::string_view label = "0::/";
  double quota = std::numeric_limits<double>::infinity();
  std::istringstream lines{std::string(memberships)};
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(label)) continue;
    std::filesystem::path group = line.substr(label.size() - 1);
    for (;; group = group.parent_path()) {
      quota = std::min(quota, quota_of_group(root / group.relative_path()));
      if (!group.has_relative_path()) break;
    }
  }
  return quota;
}

std::string host_name() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return name_from(name.data());
}

std::uint64_t num_oom_kills() { return oom_kills_in(text_of("/proc/vmstat")); }

std::uint64_t oom_kills_in(std::string_view vmstat) {
  constexpr std::string_view label = "\noom_kill ";
  const std::size_t found = vmstat.find(label);
  if (found == std::string_view::npos) return 0;
  const char* const digits = vmstat.data() + found + label.size();
  std::uint64_t count = 0;
  std::from_chars(digits, vmstat.data() + vmstat.size(), count);
  return count;
}

int wait_for_end(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return status_if_unknown;
  }
  return status;
}

std::optional<int> status_if_ended(pid_t child) {
  int status = 0;
  const pid_t ended = waitpid(child, &status, WNOHANG);
  if (ended == 0) return std::nullopt;
  return ended == child ? status : status_if_unknown;
}

std::string end_text(int status) {
  if (!WIFSIGNALED(status)) return fmt::format("exit code {}", WEXITSTATUS(status));
  const int number = WTERMSIG(status);
  return fmt::format("killed by signal {} ({})", number, strsignal(number));
}

LossReason reason_of_end(int status, bool is_memory_short) {
  if (!WIFSIGNALED(status)) return LossReason::failed;
  if (WTERMSIG(status) != SIGKILL) return LossReason::crashed;
  return is_memory_short ? LossReason::out_of_memory : LossReason::preempted;
}

}  // namespace proofmass::wire
