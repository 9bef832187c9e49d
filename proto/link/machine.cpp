#include "proto/link/machine.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "proto/wire/names.hpp"

namespace proofmass::wire {

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
