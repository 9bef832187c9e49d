#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace proofmass::coordinator {

/// The worker program that belongs to this one: the file `proofmass-worker` beside it.
/// @throws Error if it is not there.
[[nodiscard]] std::filesystem::path worker_executable();

/// Worker processes of this machine, of one thread each: what kills one costs the runs of that
/// thread only. They end with this process, however it ends.
class WorkerProcesses {
 public:
  /// A worker that ended by itself.
  struct Exit {
    std::string name;
    pid_t process_id = 0;
    std::string reason;  ///< `killed by signal 9 (Killed)`, `exit code 1`.
  };

  WorkerProcesses(std::filesystem::path executable, std::string endpoint);
  ~WorkerProcesses();  ///< Ends them: asks, waits for a moment, kills.
  WorkerProcesses(const WorkerProcesses&) = delete;
  WorkerProcesses& operator=(const WorkerProcesses&) = delete;

  /// @throws Error if the process cannot be made.
  void start(const std::string& name);

  /// Those that have ended since the last call; does not wait.
  [[nodiscard]] std::vector<Exit> take_exits();

 private:
  struct Process {
    std::string name;
    pid_t process_id = 0;
  };

  void wait_until_ended(int milliseconds_max);

  std::filesystem::path executable_;
  std::string endpoint_;
  std::vector<Process> processes_;
};

}  // namespace proofmass::coordinator
