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
  /// Keeps an entry in the file of the campaign, or in all files that it concerns (WorkerEnded) if
  /// the campaign is 0. A Delivery must lead to on_committed() with its run once it is durable, or
  /// to the end of the service; there is at most one of a run. A SecondDelivery, of a run with a
  /// Delivery before it or committed, must lead to on_compared(). The others need not be durable at
  /// once.
  virtual void write(wire::CampaignId campaign, Entry entry) = 0;

  virtual void log(Event event, wire::CampaignId campaign) = 0;
  /// An event that concerns all campaigns.
  void log(Event event) { log(std::move(event), wire::CampaignId{}); }
};

}  // namespace proofmass::coordinator
