#include "proto/link/machine.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

constexpr int status_if_unknown = W_EXITCODE(1, 0);

}  // namespace

std::string host_name() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return name_from(name.data());
}

std::uint64_t num_oom_kills() {
  std::ifstream stream("/proc/vmstat");
  return oom_kills_in(std::string(std::istreambuf_iterator<char>(stream), {}));
}

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
