#pragma once

#include <map>
#include <set>

#include "coordinator/dispatch/state.hpp"
#include "coordinator/store/store_writer.hpp"

namespace proofmass::coordinator {

/// Keeps in each campaign database which workers were lent its runs, and how they ended. The next
/// coordinator knows from it for which workers to wait. A worker that was lent no run of a campaign
/// changes nothing in its file.
class WorkerHistory {
 public:
  /// @param state, writer  Outlive this object.
  /// @param attached       Workers that may come back from the coordinator before this one.
  WorkerHistory(const State& state, StoreWriter& writer, std::set<SessionId> attached);

  /// To be called when a worker is welcome.
  void note_registered(WorkerId worker);
  /// To be called whenever runs are lent, and before anything of a worker that may be new to the
  /// campaign's file is written.
  void note_lent(CampaignId campaign, WorkerId worker);
  /// A campaign's file is closed, and knows that all of its workers have ended.
  void note_closed(CampaignId campaign);
  /// Why the worker is about to be removed, or was. Without a call the reason is `silent`.
  void note_reason(WorkerId worker, LossReason reason);

  /// Writes down who is gone. To be called some times a second.
  void review();
  /// Writes down that all workers leave that have not left yet.
  void end_all(LossReason reason);

 private:
  void end(WorkerId worker, SessionId session);

  const State& state_;
  StoreWriter& writer_;
  std::set<SessionId> attached_;
  /// A worker that is registered.
  struct Registered {
    SessionId session;
    std::set<CampaignId> campaigns;  ///< Whose files know it.
  };

  std::map<WorkerId, Registered> registered_;
  std::map<WorkerId, LossReason> reasons_;
};

}  // namespace proofmass::coordinator
