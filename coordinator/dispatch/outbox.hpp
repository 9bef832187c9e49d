#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "coordinator/store/records.hpp"
#include "core/campaign/campaign.hpp"
#include "core/runs.hpp"
#include "proto/text/event.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class Envelope;
}  // namespace proofmass::proto

namespace proofmass::coordinator {

using wire::Event;
using wire::Field;
using wire::Log;
using wire::Severity;

/// What the dispatch wants done. The service carries it out; tests record it.
class Outbox {
 public:
  virtual ~Outbox() = default;

  /// The message may be lost: the dispatch is made for that.
  /// @param message  Without version, session, epoch and sequence.
  virtual void send(wire::WorkerId worker, proto::Envelope message) = 0;
  /// Sends the part of the campaign's definition that the worker asked for. It may be lost as well.
  /// @param offset      Of the first byte of that part.
  /// @param definition  Shared with the dispatch, because it may have millions of numbers.
  virtual void send_definition(wire::WorkerId worker, wire::CampaignId campaign,
                               std::uint64_t offset,
                               const std::shared_ptr<const Campaign>& definition) = 0;
  /// Must lead to on_committed() with this run once the result is durable, or to the end of the
  /// service. Called at most once for a run.
  virtual void store(wire::WorkerId worker, wire::LeasedResult result) = 0;
  /// Must lead to on_compared() with the run once the result has been compared with the stored one.
  /// Called for runs that were handed to store() before, or committed.
  virtual void compare(wire::WorkerId worker, wire::LeasedResult result) = 0;
  /// Keeps for the history of attempts that runs came back. It need not be durable at once.
  /// @param worker  Which held them, in the session that is named.
  virtual void record(wire::CampaignId campaign, wire::WorkerId worker,
                      const ReturnedRuns& returned) = 0;
  /// The run crashed too many workers: keeps it as given up, so that the campaign can end.
  virtual void give_up(wire::CampaignId campaign, RunIndex run) = 0;
  virtual void log(Event event, wire::CampaignId campaign) = 0;
  /// An event that concerns all campaigns.
  void log(Event event) { log(std::move(event), wire::CampaignId{}); }
};

}  // namespace proofmass::coordinator
