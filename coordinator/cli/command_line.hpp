#pragma once

#include <functional>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// What is to be done once all arguments are parsed; returns an ExitCode.
using Command = std::function<int()>;

/// All of `proofmass`, from its arguments to its exit code.
/// @param add_further_commands  Declares commands that are about the model, see add_command().
[[nodiscard]] int run_proofmass(
    int argc, char** argv, const std::function<void(CLI::App&, Command&)>& add_further_commands);

/// All of `proofmass-coordinator`.
[[nodiscard]] int run_proofmass_coordinator(int argc, char** argv);

}  // namespace proofmass::coordinator
