#pragma once

#include "coordinator/cli/program.hpp"

namespace proofmass::coordinator {

/// Declares `bench`, see add_command().
void add_bench_command(CLI::App& app, Command& chosen);

}  // namespace proofmass::coordinator
