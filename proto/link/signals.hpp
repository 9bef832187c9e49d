#pragma once

namespace proofmass::wire {

/// Makes writing to a pipe that nobody reads an error like any other. Otherwise a program whose log
/// goes to `tee` or `head` is killed by SIGPIPE when that ends. start_program() gives the programs
/// that it starts the default again.
void ignore_broken_pipes();

}  // namespace proofmass::wire
