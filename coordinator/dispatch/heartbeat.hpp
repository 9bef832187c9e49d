#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

// What a heartbeat says: which runs the worker holds, and how far its batches are. The
// coordinator's view and the worker's may differ, and either may be right: messages are lost in
// both directions, workers outlive coordinators, and a silent worker's runs are lent again.

namespace proofmass::proto {
class Heartbeat;
}  // namespace proofmass::proto

namespace proofmass::coordinator::detail {

/// Makes both sides agree about which runs the worker holds.
void reconcile(State& state, WorkerId id, const proto::Heartbeat& heartbeat, TimePoint now,
               Outbox& outbox);

/// To be called when a campaign is served, or has more runs than before: lends its runs to the
/// workers that have set their results aside, so that nobody computes them again.
void adopt_set_aside(State& state, CampaignId campaign, TimePoint now);

/// Notes how many steps the worker's batches have done.
void note_progress(State& state, Worker& worker, const proto::Heartbeat& heartbeat, TimePoint now);

/// The first of the worker's batches that hangs; null if none does.
[[nodiscard]] const Progress* hung_batch(const State& state, const Worker& worker, TimePoint now);

}  // namespace proofmass::coordinator::detail
