#include "proto/link/signals.hpp"

#include <csignal>

namespace proofmass::wire {

void ignore_broken_pipes() { (void)std::signal(SIGPIPE, SIG_IGN); }

}  // namespace proofmass::wire
