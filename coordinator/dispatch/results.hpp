#pragma once

#include <span>
#include <string>
#include <vector>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

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
/// A result was compared with the stored one.
void on_compared(State& state, CampaignId id, RunIndex run, WorkerId worker, bool is_equal,
                 TimePoint now, Outbox& outbox);
/// Nothing can be stored for now: lends no more of the campaign. Results stay with the store, which
/// tries again.
void on_store_failed(State& state, CampaignId id, const std::string& reason, Outbox& outbox);
void on_store_recovered(State& state, CampaignId id, TimePoint now, Outbox& outbox);

}  // namespace proofmass::coordinator
