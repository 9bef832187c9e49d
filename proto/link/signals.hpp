#pragma once

namespace proofmass::wire {

/// Lets this process learn how its children end: if whoever started it ignores SIGCHLD, so does it,
/// and then the kernel keeps the status of no child. To be called first of all.
void keep_ends_of_children();

/// Makes writing to a pipe that nobody reads an error like any other. Otherwise a program whose log
/// goes to `tee` or `head` is killed by SIGPIPE when that ends. start_program() gives the programs
/// that it starts the default again.
void ignore_broken_pipes();

}  // namespace proofmass::wire
