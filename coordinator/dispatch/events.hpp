#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::proto {
class GiveBack;
class Heartbeat;
class Hello;
}  // namespace proofmass::proto

namespace proofmass::coordinator {

// Events of campaigns.

/// Begins to lend the runs of a campaign.
/// @pre No campaign has this id; definition->validate() passed.
void on_campaign(State& state, CampaignId id, const StoredCampaign& stored, TimePoint now,
                 Outbox& outbox);
void on_extended(State& state, CampaignId id, std::shared_ptr<const Campaign> definition,
                 TimePoint now, Outbox& outbox);
/// Changes how early the runs of the campaign are lent, and which fraction of the results that come
/// from now on is computed a second time.
void on_control(State& state, CampaignId id, int priority, double audit_fraction);
/// The runs that were given up are open again, as suspects.
void on_retry(State& state, CampaignId id, TimePoint now, Outbox& outbox);
/// Lends no more runs of the campaign until on_resume(). Runs that have not begun are asked back.
void on_pause(State& state, CampaignId id, Outbox& outbox);
/// Goes on with a campaign that is paused or cancelled.
void on_resume(State& state, CampaignId id, TimePoint now, Outbox& outbox);
/// Drops the open runs of the campaign, also at the workers. Stored results stay, and on_resume()
/// goes on with the campaign.
void on_cancel(State& state, CampaignId id, Outbox& outbox);
/// The campaign is not served any more. Workers forget it if it is finished or cancelled; otherwise
/// they keep its results. @pre None of its results is on its way to the store.
void on_removed(State& state, CampaignId id, Outbox& outbox);
/// A campaign that is not served is known to be finished or cancelled: workers that name it are
/// told to forget it, until on_campaign() or on_unlisted().
/// @param num_runs  Number of its runs. Workers keep results of later runs, which may belong to an
///                  extension that is not known here.
void on_ended(State& state, CampaignId id, std::uint64_t num_runs = num_runs_max);

/// Takes on_ended() back, because the file of the campaign is gone or has changed: workers with
/// results of it keep them. @pre It is not served.
void on_unlisted(State& state, CampaignId id);

// Events of results: a worker delivers them, and the store has written or compared them.

/// Hands results of open runs to the store, and those of others to be compared; acknowledges at
/// once those that are durable already.
/// @param attempt  Under which the runs were lent, as the worker says.
void on_results(State& state, WorkerId id, CampaignId campaign, Attempt attempt,
                std::vector<wire::ComputedRun> results, TimePoint now, Outbox& outbox);

/// Results that went to the store are durable: acknowledges them.
/// @pre Each run had a Delivery and is named here for the first time.
void on_committed(State& state, CampaignId id, std::span<const RunIndex> runs, TimePoint now,
                  Outbox& outbox);
void on_compared(State& state, CampaignId id, RunIndex run, WorkerId worker, bool is_equal,
                 TimePoint now, Outbox& outbox);
/// Nothing can be stored for now: lends no more of the campaign. Results stay with the store, which
/// tries again.
void on_store_failed(State& state, CampaignId id, const std::string& reason, Outbox& outbox);
void on_store_recovered(State& state, CampaignId id, TimePoint now, Outbox& outbox);

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

}  // namespace proofmass::coordinator
