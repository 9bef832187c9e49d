#pragma once

#include <map>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/proofmass.pb.h"
#include "proto/wire/messages.hpp"

namespace proofmass::wire {

// Parts of messages as values, and back. What is read has passed the checks of decode().

[[nodiscard]] inline bool is_of_worker(const proto::Envelope& message) {
  return message.from_worker_case() != proto::Envelope::FROM_WORKER_NOT_SET;
}
[[nodiscard]] inline bool is_of_coordinator(const proto::Envelope& message) {
  return message.from_coordinator_case() != proto::Envelope::FROM_COORDINATOR_NOT_SET;
}

using Ranges = google::protobuf::RepeatedPtrField<proto::Range>;

[[nodiscard]] std::vector<RunRange> ranges_of(const Ranges& ranges);
void add_ranges(std::span<const RunRange> ranges, Ranges& message);

[[nodiscard]] RunRange runs_of(const proto::RunLease& lease);
[[nodiscard]] std::vector<RunIndex> runs_of(const proto::ResultAck& ack);

[[nodiscard]] ComputedRun computed_run(const proto::ComputedRun& message);
/// @param message  Is empty at first.
void write_run(const ComputedRun& computed, proto::ComputedRun& message);

/// Results as messages, each of one campaign and attempt.
class ResultBatches {
 public:
  void add(CampaignId campaign, Attempt attempt, const ComputedRun& computed);
  /// Full ones first. @pre Is called once, at the end.
  [[nodiscard]] std::vector<proto::ResultBatch> take();

 private:
  std::vector<proto::ResultBatch> full_;
  std::map<std::pair<CampaignId, Attempt>, proto::ResultBatch> open_;
};

[[nodiscard]] inline LossReason loss_reason(proto::LossReason reason) {
  return static_cast<LossReason>(reason);
}
[[nodiscard]] inline proto::LossReason message_value(LossReason reason) {
  return static_cast<proto::LossReason>(reason);
}

/// A Reject, by which a coordinator answers what it does not take.
[[nodiscard]] proto::Envelope rejection(proto::RejectReason reason, std::string_view text);

}  // namespace proofmass::wire
