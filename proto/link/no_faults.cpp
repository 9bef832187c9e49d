// Of the installed programs. A separate object of its library, so that those with faults of their
// own leave it out.

#include "proto/link/faults.hpp"

namespace proofmass::wire {

void kill_point(KillPoint) {}

std::unique_ptr<LinkFaults> link_faults(LinkFaults::Direction) { return nullptr; }

void add_fault_option(CLI::App&) {}

}  // namespace proofmass::wire
