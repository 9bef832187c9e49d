#pragma once

#include <functional>
#include <string>

#include "worker/execution/executor.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::worker {

/// What makes one worker program differ from another.
struct Program {
  std::string name;  ///< In the log and in error messages.
  Prepare prepare;   ///< Called after the options have been parsed.
  std::function<void(CLI::App&)> add_options = [](CLI::App&) {};  ///< Its own ones.
};

/// All of a worker, from its arguments to its exit code: 0 told to end, 1 cannot go on, 2 wrong
/// usage, 3 a computation hangs.
[[nodiscard]] int run_worker(int argc, char** argv, const Program& program);

}  // namespace proofmass::worker
