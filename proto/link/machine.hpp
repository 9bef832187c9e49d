#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

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

/// How a process ended, for people: `exit code 1`, `killed by signal 9 (Killed)`.
/// @param status  From waitpid().
[[nodiscard]] std::string end_text(int status);

/// Why the runs of a worker process that has ended are lost: `failed` if it exited by itself,
/// `crashed` if a signal ended it. SIGKILL means `out_of_memory` if the kernel ended a process for
/// lack of memory meanwhile, and `preempted` otherwise: somebody ended it, and no run is blamed.
/// @param status  From waitpid().
[[nodiscard]] LossReason reason_of_end(int status, bool is_memory_short);

}  // namespace proofmass::wire
