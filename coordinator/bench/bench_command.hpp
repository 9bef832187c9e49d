#pragma once

#include "coordinator/cli/command_line.hpp"

namespace proofmass::coordinator {

/// Declares `bench`, see add_command().
void add_bench_command(CLI::App& app, Command& chosen);

}  // namespace proofmass::coordinator
