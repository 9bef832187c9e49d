#pragma once

#include <cstdint>
#include <string_view>

#include "proto/wire/messages.hpp"

namespace proofmass::wire {

/// How many processes the kernel of this machine has ended for want of memory since it started.
[[nodiscard]] std::uint64_t num_oom_kills();

/// The same from the text of /proc/vmstat; 0 if it does not say.
[[nodiscard]] std::uint64_t oom_kills_in(std::string_view vmstat);

/// Why the runs of a worker process are lost. A signal counts against them (`crashed`), but SIGKILL
/// only if the kernel ended a process for want of memory meanwhile (`out_of_memory`): otherwise
/// somebody ended it (`preempted`). `failed` if it exited by itself.
/// @param status  As waitpid() tells it.
[[nodiscard]] LossReason reason_of_end(int status, bool is_memory_short);

}  // namespace proofmass::wire
