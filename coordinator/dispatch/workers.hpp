#pragma once

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator::detail {

/// The worker of a message, marked as heard; null, and told so, if it is not registered.
Worker* heard(State& state, WorkerId id, TimePoint now, Outbox& outbox);

/// Its process ended, or must end: logs it and forgets the worker, blaming what has to be. The
/// caller settles.
void part_with(State& state, WorkerId id, LossReason reason, Outbox& outbox);

/// A batch of the worker hangs: tells it to end, and parts with it.
void part_with_hung(State& state, WorkerId id, const wire::ComputedBatch& batch, Outbox& outbox);

/// Makes both sides agree about what the worker holds.
void reconcile(State& state, WorkerId id, const wire::Heartbeat& heartbeat, TimePoint now,
               Outbox& outbox);

/// A campaign is served, or has more runs than before: what workers computed of it without being
/// able to deliver it is lent to them.
void adopt_set_aside(State& state, CampaignId campaign, TimePoint now);

/// Notes how far the worker's batches are.
void note_progress(State& state, Worker& worker, const wire::Heartbeat& heartbeat, TimePoint now);

/// The first of the worker's batches that comes no further; null if all do.
[[nodiscard]] const wire::ComputedBatch* hung_batch(const State& state, const Worker& worker,
                                                    TimePoint now);

/// Nothing waits to be lent: gives idle workers a part of what others are too slow with.
void speculate(State& state, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator::detail
