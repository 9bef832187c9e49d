#pragma once

#include <cstdint>
#include <memory>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"

namespace proofmass::coordinator {

// Events of campaigns.

/// Begins to lend the runs of a campaign.
/// @pre No campaign has this id; definition->validate() passed.
void on_campaign(State& state, CampaignId id, const StoredCampaign& stored, TimePoint now,
                 Outbox& outbox);
/// The campaign has more runs than before.
void on_extended(State& state, CampaignId id, std::shared_ptr<const Campaign> definition,
                 TimePoint now, Outbox& outbox);
/// Changes how early the runs of the campaign are lent, and which fraction of the results that come
/// from now on is computed a second time.
void on_control(State& state, CampaignId id, int priority, double audit_fraction);
/// The runs that were given up are open again, as suspects.
void on_retry(State& state, CampaignId id, TimePoint now, Outbox& outbox);
/// Lends no more runs of the campaign until on_resume(). Runs that have not begun are asked back.
void on_pause(State& state, CampaignId id, Outbox& outbox);
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

}  // namespace proofmass::coordinator
