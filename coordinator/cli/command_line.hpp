#pragma once

#include <functional>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// What is to be done once all arguments are parsed; returns an ExitCode.
using Command = std::function<int()>;

/// Declares `run`, `init` and `keygen`.
/// @param chosen  Set while the arguments are parsed; outlives `app`.
void add_local_commands(CLI::App& app, Command& chosen);

/// Declares `report`, `sensitivity` and `query`.
/// @param chosen  As above.
void add_analysis_commands(CLI::App& app, Command& chosen);

/// Declares `submit`, `status`, `watch`, `pause`, `resume`, `cancel` and `workers`.
/// @param chosen  As above.
void add_client_commands(CLI::App& app, Command& chosen);

/// Declares `verify`, `export`, `backup`, `compare`, `list`, `tag` and `note`.
/// @param chosen  As above.
void add_archive_commands(CLI::App& app, Command& chosen);

/// All of `proofmass`, from its arguments to its exit code.
/// @param add_further_commands  Declares commands that are about the model, as above.
[[nodiscard]] int run_proofmass(
    int argc, char** argv, const std::function<void(CLI::App&, Command&)>& add_further_commands);

}  // namespace proofmass::coordinator
