#pragma once

#include <cstdint>
#include <string>

#include "coordinator/cli/progress_display.hpp"
#include "coordinator/cli/worker_processes.hpp"
#include "coordinator/net/service.hpp"

namespace proofmass::coordinator {

/// The local workers of a campaign: starts them, and others in the place of those that die.
class LocalWorkers {
 public:
  /// @param service, display  Outlive this object.
  LocalWorkers(Service& service, ProgressDisplay& display);

  void start(std::uint64_t num_workers);

  /// @throws Error if workers end again and again without finishing a run, unless that is the fault
  ///         of single runs, which the dispatch finds out.
  void replace_dead();

 private:
  void replace(const WorkerProcesses::Exit& exit);
  void check(const WorkerProcesses::Exit& exit, const std::string& runs);

  Service& service_;
  ProgressDisplay& display_;
  WorkerProcesses processes_;
  std::string host_;
  int num_failures_ = 0;  ///< In a row, without a finished run.
  std::uint64_t num_done_at_failure_ = 0;
};

}  // namespace proofmass::coordinator
