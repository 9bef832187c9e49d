#include "proto/link/machine.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <latch>
#include <limits>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/wire/names.hpp"

extern char** environ;

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

// Opened the other way round: reading and writing fail as on a closed descriptor.
void occupy_standard_descriptors() {
  for (int descriptor = 0; descriptor < 3; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0) continue;
    if (::open("/dev/null", descriptor == 0 ? O_WRONLY : O_RDONLY) == descriptor) continue;
    throw Error(fmt::format("descriptor = {} (is closed, and /dev/null cannot take its place: {})",
                            descriptor, std::strerror(errno)));
  }
}

void settle_signals() {
  sigset_t none;
  sigemptyset(&none);
  ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
  (void)std::signal(SIGCHLD, SIG_DFL);
  (void)std::signal(SIGXFSZ, SIG_IGN);
}

struct Limit {
  int resource;
  std::string_view name;
  rlim_t least, usual;
  std::string_view remedy;
};

// Half of that stack is too little for a batch; ZeroMQ aborts where it finds no descriptor.
constexpr Limit stack_size{RLIMIT_STACK, "stack in bytes", 256 << 10, 8 << 20, "ulimit -s"};
constexpr Limit num_descriptors{RLIMIT_NOFILE, "descriptors", 48, 1024, "ulimit -n"};

/// Raises a limit that is below the usual, as far as this user may.
void settle(const Limit& limit) {
  rlimit now{};
  if (::getrlimit(limit.resource, &now) != 0 || now.rlim_cur >= limit.usual) return;
  now.rlim_cur = std::min(now.rlim_max, limit.usual);
  if (::setrlimit(limit.resource, &now) == 0 && now.rlim_cur >= limit.least) return;
  throw Error(fmt::format("{} = {} (must be at least {}; raise `{}`)", limit.name, now.rlim_cur,
                          limit.least, limit.remedy));
}

// Stacks of other threads are as large as the limit was when the program began.
void settle_stacks() {
  settle(stack_size);
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_size.usual);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

constexpr std::chrono::seconds status_interval(5);

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// The number that is the whole text; nothing if it is not one, or is 0.
std::optional<std::int64_t> positive_number(std::string_view text) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = error == std::errc{} && end == text.data() + text.size();
  return is_number && number > 0 ? std::optional(number) : std::nullopt;
}

/// As posix_spawn() takes them; it does not write to them.
std::vector<char*> pointers_to(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
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

std::uint64_t random_number() {
  std::random_device device;
  std::uint64_t number = 0;
  while (number == 0) number = (std::uint64_t{device()} << 32) | device();
  return number;
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

std::optional<int> status_at_end(pid_t child, const std::function<bool()>& may_go_on) {
  for (;;) {
    if (const std::optional<int> status = status_if_ended(child)) return status;
    if (!may_go_on()) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ::kill(child, SIGKILL);
  (void)wait_for_end(child);
  return std::nullopt;
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

void settle_surroundings() {
  occupy_standard_descriptors();
  settle_signals();
  settle_stacks();
  settle(num_descriptors);
}

void require_threads(int count) {
  std::latch end(1);
  std::vector<std::jthread> threads;
  int error = 0;
  try {
    for (int i = 0; i < count; ++i) threads.emplace_back([&end] { end.wait(); });
  } catch (const std::system_error& failure) {
    error = failure.code().value();
  }
  end.count_down();
  if (error == 0) return;
  throw Error(
      fmt::format("threads = {} (must be at least {}: {}; raise `ulimit -u`, `ulimit -v`, "
                  "or the limit of the service or container)",
                  threads.size(), count, std::strerror(error)));
}

void ignore_broken_pipes() { (void)std::signal(SIGPIPE, SIG_IGN); }

ServiceNotices::ServiceNotices() : ServiceNotices(environment("NOTIFY_SOCKET"), std::nullopt) {
  if (const auto number = positive_number(environment("WATCHDOG_USEC"))) {
    watchdog_ = std::chrono::microseconds(*number);
  }
}

ServiceNotices::ServiceNotices(std::string socket,
                               std::optional<std::chrono::microseconds> watchdog)
    : socket_(std::move(socket)), watchdog_(watchdog) {}

void ServiceNotices::notify(std::string_view line) const {
  sockaddr_un address{};
  if (socket_.empty() || socket_.size() >= sizeof address.sun_path) return;
  address.sun_family = AF_UNIX;
  socket_.copy(address.sun_path, socket_.size());
  if (socket_.front() == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + socket_.size());
  const Descriptor file(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  [[maybe_unused]] const auto sent = sendto(file.number(), line.data(), line.size(), MSG_NOSIGNAL,
                                            reinterpret_cast<const sockaddr*>(&address), size);
}

void ServiceNotices::ready() {
  if (!std::exchange(is_ready_, true)) notify("READY=1");
}

void ServiceNotices::stopping() {
  if (!std::exchange(is_stopping_, true)) notify("STOPPING=1");
}

void ServiceNotices::on_tick(TimePoint now, const std::function<std::string()>& status) {
  if (watchdog_ && now >= watchdog_at_) {
    watchdog_at_ = now + *watchdog_ / 2;
    notify("WATCHDOG=1");
  }
  if (now < status_at_) return;
  status_at_ = now + status_interval;
  notify("STATUS=" + status());
}

pid_t start_program(const ProgramStart& start) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  int number = 0;
  for (const int descriptor : start.descriptors) {
    posix_spawn_file_actions_adddup2(&actions, descriptor, number++);
  }
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  sigset_t defaulted = none;
  sigaddset(&defaulted, SIGPIPE);
  posix_spawnattr_setsigdefault(&attributes, &defaulted);
  const int group = start.has_own_group ? POSIX_SPAWN_SETPGROUP : 0;
  posix_spawnattr_setflags(
      &attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | group));
  const std::vector<char*> arguments = pointers_to(start.arguments);
  std::vector<char*> environment;
  if (start.environment) environment = pointers_to(*start.environment);
  pid_t process_id = 0;
  const int error =
      posix_spawnp(&process_id, arguments.front(), &actions, &attributes, arguments.data(),
                   start.environment ? environment.data() : environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return process_id;
  throw Error(fmt::format("{}: cannot be started: {}", start.arguments.front(),
                          std::generic_category().message(error)));
}

std::vector<std::string> environment_without_settings() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    const bool is_setting = text.starts_with("PROOFMASS_") || text.starts_with("NOTIFY_SOCKET=") ||
                            text.starts_with("SLURM_JOB_END_TIME=");
    if (!is_setting) variables.emplace_back(text);
  }
  return variables;
}

std::filesystem::path program_beside_this(std::string_view name) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  std::filesystem::path program = self.parent_path() / name;
  if (!error && access(program.c_str(), X_OK) == 0) return program;
  throw Error(
      fmt::format("program = {} (must be beside {})", program.string(), self.filename().string()));
}

std::string shell_word(std::string_view text) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '/' || c == '-' || c == '+';
  };
  if (!text.empty() && std::ranges::all_of(text, is_plain) && text[0] != '-') {
    return std::string(text);
  }
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

}  // namespace proofmass::wire
