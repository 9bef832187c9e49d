#pragma once

namespace proofmass::wire {

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

}  // namespace proofmass::wire
