#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

// Lends runs to workers and takes their results: one function for each thing that can happen. They
// know no socket, clock, thread or log; what follows from an event goes to the outbox.
//
// Workers hold and repeat what has not been answered; a heartbeat says all that a worker holds, so
// both sides agree again after any loss; a run has one place in the state. So any message may be
// lost, repeated or overtaken: runs are then computed twice at worst, and stored once.
//
// An event of a worker that is not registered, or not any more, is answered with
// Reject{not_registered}: it registers again and says what it holds, and its results are welcome.
// The caller has checked the header's epoch: a message with another one is not handed in but
// answered by reject_unregistered().

// Campaigns.

/// Begins to lend the runs of a campaign.
/// @pre No campaign has this id; definition->validate() passed.
void on_campaign(State& state, CampaignId id, const StoredCampaign& stored, TimePoint now,
                 Outbox& outbox);
/// The campaign has more runs than before.
void on_extended(State& state, CampaignId id, std::shared_ptr<const Campaign> definition,
                 TimePoint now, Outbox& outbox);
/// Its runs are lent earlier or later than before, and more or fewer of the results that come from
/// now on are computed a second time.
void on_control(State& state, CampaignId id, int priority, double audit_fraction);
/// The runs that were given up are open again, as suspects.
void on_retry(State& state, CampaignId id, TimePoint now, Outbox& outbox);
/// Lends no more of it until on_resume(); runs that are not being computed are asked back.
void on_pause(State& state, CampaignId id, Outbox& outbox);
void on_resume(State& state, CampaignId id, TimePoint now, Outbox& outbox);
/// Drops its open runs; workers forget them. What is stored stands, and on_resume() goes on.
void on_cancel(State& state, CampaignId id, Outbox& outbox);
/// Serves a campaign no more, of which nothing is on its way to the store. Workers forget it if it
/// is finished or cancelled; otherwise they keep its results.
void on_removed(State& state, CampaignId id, Outbox& outbox);
/// A campaign that is not served is finished or cancelled: workers that ask for it are told to
/// forget it. on_campaign() ends that.
/// @param num_runs  Its runs; workers keep results from there on, as of an extension that is not
///                  known here.
void on_ended(State& state, CampaignId id, std::uint64_t num_runs = num_runs_max);

/// The file of a campaign that has ended is not there any more, or holds something else:
/// workers with results of it keep them. @pre It is not served.
void on_unlisted(State& state, CampaignId id);

// Workers.

/// Answers a message of a worker that is not registered, or of another epoch.
void reject_unregistered(WorkerId id, Outbox& outbox);
/// Calls the function below that is for the message.
/// @param key  Public key of the connection; empty without keys.
/// @pre The message is one of a worker.
void on_packet(State& state, WorkerId id, const std::string& key, wire::Packet packet,
               TimePoint now, Outbox& outbox);
/// Registers a worker, or answers again if it is registered already.
/// @param key  Public key of the connection; empty without keys. What is said about a host counts
///             for workers with this key only.
void on_hello(State& state, WorkerId id, SessionId session, const std::string& key,
              const wire::Hello& hello, TimePoint now, Outbox& outbox);
/// Workers of a quarantined host are taken again, whatever their keys.
/// @return False if it is not quarantined.
bool on_release_host(State& state, const std::string& host, TimePoint now, Outbox& outbox);
/// Answers with a part of the definition.
void on_campaign_request(State& state, WorkerId id, const wire::CampaignRequest& request,
                         TimePoint now, Outbox& outbox);
/// Makes both sides agree about what the worker holds, and lends runs up to its share.
/// @param sequence  Of the header; a heartbeat older than the newest one is ignored.
void on_heartbeat(State& state, WorkerId id, const wire::Heartbeat& heartbeat,
                  std::uint64_t sequence, TimePoint now, Outbox& outbox);
/// Hands results of open runs to the store, and those of others to be compared; acknowledges at
/// once those that are durable already.
void on_results(State& state, WorkerId id, wire::ResultBatch batch, TimePoint now, Outbox& outbox);
void on_give_back(State& state, WorkerId id, const wire::GiveBack& give_back, TimePoint now,
                  Outbox& outbox);
void on_bye(State& state, WorkerId id, const wire::Bye& bye, TimePoint now, Outbox& outbox);
/// The worker is known to be gone, or must be.
void on_gone(State& state, WorkerId id, LossReason reason, TimePoint now, Outbox& outbox);

// Storage.

/// Results that went to the store are durable: acknowledges them.
/// @pre Each run was handed to Outbox::store() and is named here for the first time.
void on_committed(State& state, CampaignId id, std::span<const RunIndex> runs, TimePoint now,
                  Outbox& outbox);
/// A result was compared with the stored one.
void on_compared(State& state, CampaignId id, RunIndex run, WorkerId worker, bool is_equal,
                 TimePoint now, Outbox& outbox);
/// Nothing can be stored for now: lends no more of the campaign. Results stay with the store, which
/// tries again.
void on_store_failed(State& state, CampaignId id, const std::string& reason, Outbox& outbox);
void on_store_recovered(State& state, CampaignId id, TimePoint now, Outbox& outbox);

// Time and the end.

/// Time has passed: takes back the runs of workers that are silent or hang, and copies the last
/// ones.
void on_tick(State& state, TimePoint now, Outbox& outbox);
/// Lends nothing more; workers deliver what they hold and leave.
void on_drain(State& state, Outbox& outbox);
/// Lends nothing more; workers drop what they hold and end.
void on_stop(State& state, Outbox& outbox);

}  // namespace proofmass::coordinator
