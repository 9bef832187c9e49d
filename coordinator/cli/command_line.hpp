#pragma once

#include <functional>

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// What is to be done once all arguments are parsed; returns an ExitCode.
using Command = std::function<int()>;

/// Declares `run`, `init`, `bench` and `keygen`.
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

}  // namespace proofmass::coordinator
