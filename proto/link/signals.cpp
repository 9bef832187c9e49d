#include "proto/link/signals.hpp"

#include <csignal>

namespace proofmass::wire {

void keep_ends_of_children() { (void)std::signal(SIGCHLD, SIG_DFL); }

void ignore_broken_pipes() { (void)std::signal(SIGPIPE, SIG_IGN); }

}  // namespace proofmass::wire
