#include "coordinator/net/worker_history.hpp"

#include <utility>

namespace proofmass::coordinator {

WorkerHistory::WorkerHistory(const State& state, StoreWriter& writer, std::set<SessionId> attached)
    : state_(state), writer_(writer), attached_(std::move(attached)) {}

void WorkerHistory::note_registered(WorkerId id) {
  const auto found = state_.workers.find(id);
  if (found == state_.workers.end() || registered_.contains(id)) return;
  registered_[id] = {.session = found->second.session, .campaigns = {}};
  attached_.erase(found->second.session);
}

void WorkerHistory::note_lent(CampaignId campaign, WorkerId id) {
  note_registered(id);
  const auto known = registered_.find(id);
  const auto found = state_.workers.find(id);
  if (known == registered_.end() || found == state_.workers.end()) return;
  if (!known->second.campaigns.insert(campaign).second) return;
  const Worker& worker = found->second;
  writer_.write(campaign, WorkerJoined{.session = worker.session,
                                       .name = worker.name,
                                       .host = worker.host_name,
                                       .process_id = worker.process_id,
                                       .num_slots = worker.num_slots,
                                       .cards = worker.cards});
}

void WorkerHistory::note_closed(CampaignId campaign) {
  for (auto& [id, worker] : registered_) worker.campaigns.erase(campaign);
}

void WorkerHistory::note_reason(WorkerId worker, LossReason reason) {
  if (registered_.contains(worker)) reasons_[worker] = reason;
}

void WorkerHistory::review() {
  for (const auto& [id, worker] : state_.workers) note_registered(id);
  const auto registered = registered_;
  for (const auto& [id, worker] : registered) {
    if (!state_.workers.contains(id)) end(id, worker.session);
  }
  if (!state_.awaited.empty()) return;
  for (const SessionId session : std::exchange(attached_, {})) {
    writer_.write({}, WorkerEnded{.session = session, .reason = LossReason::silent});
  }
}

void WorkerHistory::end_all(LossReason reason) {
  review();
  const auto registered = registered_;
  for (const auto& [id, worker] : registered) {
    reasons_.try_emplace(id, reason);
    end(id, worker.session);
  }
}

void WorkerHistory::end(WorkerId worker, SessionId session) {
  const auto reason = reasons_.find(worker);
  writer_.write(
      {}, WorkerEnded{.session = session,
                      .reason = reason == reasons_.end() ? LossReason::silent : reason->second});
  registered_.erase(worker);
  reasons_.erase(worker);
}

}  // namespace proofmass::coordinator
