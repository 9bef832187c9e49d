#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/wire/messages.hpp"

namespace proofmass::wire {

// What this machine says of itself and of the processes on it.

/// Whether a program may be given less address space than it asks for: sanitizers reserve
/// terabytes.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool has_address_space_limit = false;
#else
inline constexpr bool has_address_space_limit = true;
#endif

/// The name of this machine, with `-` for each character that is_name() does not allow.
[[nodiscard]] std::string host_name();

/// A random number, not 0.
[[nodiscard]] std::uint64_t random_number();

/// Processors that this process may use: those of its affinity mask, and no more than the quota of
/// its control groups, rounded up. At least 1.
[[nodiscard]] unsigned num_processors();

/// The quota of a process in processors, the smallest of its control groups and those above them;
/// infinite if there is none. Of control groups of version 2.
/// @param memberships  As in /proc/self/cgroup.
/// @param root         Where control groups are mounted: /sys/fs/cgroup.
[[nodiscard]] double processor_quota(std::string_view memberships,
                                     const std::filesystem::path& root);

/// Number of processes that the kernel has ended for lack of memory since the machine started.
[[nodiscard]] std::uint64_t num_oom_kills();

/// Reads num_oom_kills() from the text of /proc/vmstat; 0 if the text does not have it.
[[nodiscard]] std::uint64_t oom_kills_in(std::string_view vmstat);

/// Waits until a child process ends.
/// @return What waitpid() says of it. A child whose status the kernel does not keep counts as one
///         that exited with 1, so that it is not taken for a success.
[[nodiscard]] int wait_for_end(pid_t child);

/// The exit code that wait_for_end() returns, of a child process that has ended; nothing if it has
/// not. Does not wait.
[[nodiscard]] std::optional<int> status_if_ended(pid_t child);

/// Waits until a child process ends. Asks 100 times a second whether it may go on, and kills it
/// otherwise.
/// @return As wait_for_end(); nothing if it was killed.
[[nodiscard]] std::optional<int> status_at_end(pid_t child, const std::function<bool()>& may_go_on);

/// How a process ended, for people: `exit code 1`, `killed by signal 9 (Killed)`.
/// @param status  From waitpid().
[[nodiscard]] std::string end_text(int status);

/// Why the runs of a worker process that has ended are lost: `failed` if it exited by itself,
/// `crashed` if a signal ended it. SIGKILL means `out_of_memory` if the kernel ended a process for
/// lack of memory meanwhile, and `preempted` otherwise: somebody ended it, and no run is blamed.
/// @param status  From waitpid().
[[nodiscard]] LossReason reason_of_end(int status, bool is_memory_short);

// What a process has from whoever started it.

/// Makes the surroundings those that the program expects. To be called first of all:
/// - Descriptors 0 to 2 that are closed stay unusable, but no file or socket gets their numbers: it
///   would be written to as standard output.
/// - No signal is blocked. SIGCHLD is not ignored, with which the kernel keeps the status of no
///   child. SIGXFSZ is: a file beyond the limit for files is an error like a full disk.
/// - Threads have stacks of the usual 8 MiB; limits below the usual for stacks and descriptors are
///   raised to it as far as this user may.
///
/// @throws Error if a closed descriptor cannot be taken, or a limit stays too low.
void settle_surroundings();

/// For what aborts where it can start no thread, as ZeroMQ does.
/// @throws Error naming the limit if so many more cannot be had now.
void require_threads(int count);

/// Makes writing to a pipe that nobody reads an error like any other. Otherwise a program whose log
/// goes to `tee` or `head` is killed by SIGPIPE when that ends. start_program() gives the programs
/// that it starts the default again.
void ignore_broken_pipes();

/// Tells the init system that started this process how the service is, as systemd's sd_notify(3)
/// describes it. Without an init system, nothing happens; what cannot be sent is lost.
class ServiceNotices {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// To the init system of NOTIFY_SOCKET and WATCHDOG_USEC.
  ServiceNotices();
  /// @param socket    Path, or `@NAME` of an abstract socket; empty if there is no init system.
  /// @param watchdog  It ends a process that says nothing for this long.
  ServiceNotices(std::string socket, std::optional<std::chrono::microseconds> watchdog);

  /// The service is ready. Only the first call says so.
  void ready();
  /// The service is ending. Only the first call says so.
  void stopping();
  /// Says that the service lives, twice as often as the init system needs to hear it, and every 5 s
  /// what it does. To be called several times a second.
  void on_tick(TimePoint now, const std::function<std::string()>& status);

 private:
  void notify(std::string_view line) const;

  std::string socket_;
  std::optional<std::chrono::microseconds> watchdog_;
  bool is_ready_ = false;
  bool is_stopping_ = false;
  TimePoint watchdog_at_ = TimePoint::min();
  TimePoint status_at_ = TimePoint::min();
};

/// A program to be started as a process of its own.
struct ProgramStart {
  /// The program first: a path, or a name that is looked for in PATH.
  std::vector<std::string> arguments;
  /// That become its standard input, output and error, and further ones from 3 on.
  std::vector<int> descriptors{0, 1, 2};
  /// `NAME=value` each; that of this process by default.
  std::optional<std::vector<std::string>> environment = {};
  /// Signals of the terminal, such as that of Ctrl-C, do not reach it.
  bool has_own_group = false;
};

/// Starts the program with no signal blocked and SIGPIPE not ignored, whatever holds here.
/// @returns Its process id; the caller waits for its end.
/// @throws Error reading `PROGRAM: cannot be started: reason`.
[[nodiscard]] pid_t start_program(const ProgramStart& start);

/// The environment of this process without the variables that set options of Proofmass's programs
/// (`PROOFMASS_*`, `SLURM_JOB_END_TIME`) or name an init system: they are meant for this process,
/// or for workers elsewhere.
[[nodiscard]] std::vector<std::string> environment_without_settings();

/// Another program of Proofmass: the file of that name beside the program that runs.
/// @throws Error reading `program = PATH (rule)` if it is not there or cannot be executed.
[[nodiscard]] std::filesystem::path program_beside_this(std::string_view name);

/// The text as one word of a command line for a POSIX shell.
[[nodiscard]] std::string shell_word(std::string_view text);

}  // namespace proofmass::wire
