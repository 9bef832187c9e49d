#pragma once

#include <cstdint>
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

/// Number of processes that the kernel has ended for lack of memory since the machine started.
[[nodiscard]] std::uint64_t num_oom_kills();

/// The same number, from the text of /proc/vmstat; 0 if the text does not have it.
[[nodiscard]] std::uint64_t oom_kills_in(std::string_view vmstat);

/// How a process ended, for people: `exit code 1`, `killed by signal 9 (Killed)`.
/// @param status  From waitpid().
[[nodiscard]] std::string end_text(int status);

/// Why the runs of a worker process that has ended are lost: `failed` if it exited by itself,
/// `crashed` if a signal ended it. SIGKILL means `out_of_memory` if the kernel ended a process for
/// lack of memory meanwhile, and `preempted` otherwise: somebody ended it, and no run is blamed.
/// @param status  From waitpid().
[[nodiscard]] LossReason reason_of_end(int status, bool is_memory_short);

}  // namespace proofmass::wire
