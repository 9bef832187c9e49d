#pragma once

#include <filesystem>
#include <functional>

#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/commands/commands.hpp"

namespace proofmass::coordinator {

/// Prints checks of a file as soon as they are made, and what came of them.
/// @param make_checks  Calls its argument with each, and returns true if none fails.
/// @return exit_done or exit_cannot_be_done.
int print_checks(const std::filesystem::path& file, OutputFormat format,
                 const std::function<bool(const std::function<void(const Check&)>&)>& make_checks);

}  // namespace proofmass::coordinator
