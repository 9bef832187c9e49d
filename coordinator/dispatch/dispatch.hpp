#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

// Lends runs to workers and takes their results: one function for each thing that can happen. They
// know no socket, clock, thread or log; what follows from an event goes to the outbox.
//
// Workers hold and repeat what has not been answered, credit is absolute, and a run has one place
// in the state. So any message may be lost, repeated or overtaken: runs are then computed twice at
// worst, and stored once.
//
// An event of a worker that is not registered, or not any more, is answered with
// Reject{not_registered}: it registers again and repeats its results, which are welcome if their
// runs are still open.

/// Registers a worker, or answers again if it is registered already.
void on_hello(State& state, WorkerId id, const wire::Hello& hello, TimePoint now, Outbox& outbox);

/// Lends runs up to the worker's share.
void on_credit(State& state, WorkerId id, const wire::Credit& credit, TimePoint now,
               Outbox& outbox);

/// Hands results of open runs to the store; acknowledges at once those that are durable already.
void on_results(State& state, WorkerId id, const wire::ResultBatch& batch, TimePoint now,
                Outbox& outbox);

/// Results that went to the store are durable: acknowledges them. With the last run of the campaign
/// all workers are told to stop.
/// @pre Each run was handed to Outbox::store() and is named here for the first time.
void on_committed(State& state, std::span<const RunIndex> runs, Outbox& outbox);

/// Takes back leases that never arrived.
void on_heartbeat(State& state, WorkerId id, const wire::Heartbeat& heartbeat, TimePoint now,
                  Outbox& outbox);

/// The worker leaves.
void on_bye(State& state, WorkerId id, TimePoint now, Outbox& outbox);

/// The worker is known to be gone, or must be: its process ended or it broke the protocol.
void on_gone(State& state, WorkerId id, const std::string& reason, TimePoint now, Outbox& outbox);

/// Time has passed: runs of workers that have been silent for too long are lent again.
void on_tick(State& state, TimePoint now, Outbox& outbox);

/// Lends nothing more; workers deliver what they hold and leave.
void on_drain(State& state, Outbox& outbox);

/// Lends nothing more; workers drop what they hold and end.
void on_stop(State& state, Outbox& outbox);

}  // namespace proofmass::coordinator
