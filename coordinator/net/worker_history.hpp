#pragma once

#include <map>
#include <set>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/store/store_writer.hpp"

namespace proofmass::coordinator {

/// Keeps in the campaign files which workers are registered, so that the next coordinator knows
/// whom to wait for, and how each worker ended.
class WorkerHistory {
 public:
  /// @param state, writer  Outlive this object.
  /// @param attached       Workers that may come back from the coordinator before this one.
  WorkerHistory(const State& state, StoreWriter& writer, std::set<SessionId> attached);

  /// To be called before anything of a worker that may be new is written.
  void note_registered(WorkerId worker);
  /// Why the worker is about to be removed, or was; `silent` if nobody says so.
  void note_reason(WorkerId worker, LossReason reason);

  /// Writes down who is gone. To be called some times a second.
  void review();
  /// Writes down that all others leave as well.
  void end_all(LossReason reason);

 private:
  void end(WorkerId worker, SessionId session);

  const State& state_;
  StoreWriter& writer_;
  std::set<SessionId> attached_;
  std::map<WorkerId, SessionId> registered_;
  std::map<WorkerId, LossReason> reasons_;
};

}  // namespace proofmass::coordinator
