#pragma once

#include <cstdint>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::proto {
class GiveBack;
class Heartbeat;
class Hello;
}  // namespace proofmass::proto

namespace proofmass::coordinator {

// Events of workers, of time and of the end of the service.
//
// Any message between a worker and the coordinator may be lost, repeated or overtaken by another.
// A worker repeats what has not been answered, and its heartbeats list all runs that it holds, so
// that both sides agree again after any loss. In the worst case a run is computed twice; it is
// stored once.
//
// A worker that is not registered, or no longer, is answered with Reject{not_registered}. It then
// registers again and lists what it holds; its results are accepted. The caller has compared the
// epoch in the header with its own: a message with another epoch is not handed in, but answered by
// reject_unregistered().

/// Answers a message of a worker that is not registered, or of another epoch.
void reject_unregistered(WorkerId id, Outbox& outbox);
/// Calls the event of the message: one of those below, or on_results().
/// @param from  The key and the address of the connection.
/// @pre wire::is_of_worker(message).
void on_message(State& state, WorkerId id, const HostId& from, const proto::Envelope& message,
                TimePoint now, Outbox& outbox);
/// Registers a worker, or answers again if it is registered already.
/// @param from  The key and the address of the connection: whatever the worker calls its host.
void on_hello(State& state, WorkerId id, SessionId session, const HostId& from,
              const proto::Hello& hello, TimePoint now, Outbox& outbox);
/// Workers of a quarantined host are taken again, whatever their keys.
/// @param host  Its address, or the name that its workers gave.
/// @return False if it is not quarantined.
bool on_release_host(State& state, const std::string& host, TimePoint now, Outbox& outbox);
/// Answers with a part of the definition.
/// @param offset  Of its first byte.
void on_campaign_request(State& state, WorkerId id, CampaignId campaign, std::uint64_t offset,
                         TimePoint now, Outbox& outbox);
/// Makes both sides agree about what the worker holds, and lends runs up to its share.
/// @param sequence  Of the header; a heartbeat older than the newest one is ignored.
void on_heartbeat(State& state, WorkerId id, const proto::Heartbeat& heartbeat,
                  std::uint64_t sequence, TimePoint now, Outbox& outbox);
/// The worker will not compute these runs: lends them to others.
void on_give_back(State& state, WorkerId id, const proto::GiveBack& give_back, TimePoint now,
                  Outbox& outbox);
/// The worker leaves: lends to others what it holds. No run is blamed.
void on_bye(State& state, WorkerId id, LossReason reason, TimePoint now, Outbox& outbox);
/// The worker's process has ended, or is taken for ended. Lends to others what it holds, and blames
/// runs if the reason says that one of them may be the cause.
void on_gone(State& state, WorkerId id, LossReason reason, TimePoint now, Outbox& outbox);

// Time and the end.

/// To be called several times a second: parts with workers that are silent or hang, lends their
/// runs to others, and copies runs to idle workers at the end of a campaign.
void on_tick(State& state, TimePoint now, Outbox& outbox);
/// Lends nothing more. Workers deliver what they hold and leave.
void on_drain(State& state, Outbox& outbox);
/// Lends nothing more. Workers drop what they hold and end.
void on_stop(State& state, Outbox& outbox);
/// The last event, when all has been stored: workers that have not left are noted as leaving.
void on_end(State& state, Outbox& outbox);

namespace detail {

/// The worker that sent a message, with the time noted at which it was heard. If it is not
/// registered, it is told so, and the result is null.
Worker* heard(State& state, WorkerId id, TimePoint now, Outbox& outbox);

}  // namespace detail
}  // namespace proofmass::coordinator
