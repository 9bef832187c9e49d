#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "proto/proofmass.pb.h"
#include "proto/wire/messages.hpp"

namespace google::protobuf {
class Arena;
}  // namespace google::protobuf

namespace proofmass::wire {

enum class DecodeFault : std::uint8_t {
  too_large,      ///< More bytes than its kind may have.
  unparsable,     ///< Not an envelope.
  wrong_version,  ///< Another protocol version.
  empty,          ///< An envelope without a message of a known kind.
  invalid,        ///< A message with a value that the rules forbid.
};

struct DecodeError {
  DecodeFault fault = DecodeFault::unparsable;
  std::string text;  ///< `field = value (rule)`, for logs and for the peer.
};

/// The bytes of a message. Its version becomes protocol_version.
/// @throws InvalidArgument if they are more than a message may have.
[[nodiscard]] std::string encode(proto::Envelope envelope);

/// Checks everything: sizes, counts, enumerators, that numbers are finite. What it returns can be
/// used without further checks of form; a text for people has printable characters only.
///
/// @param bytes  Anything at all, from anybody.
[[nodiscard]] std::variant<proto::Envelope, DecodeError> decode(std::string_view bytes);
/// In an arena, where the parts of a batch of results, of which there are thousands, are freed at
/// once.
[[nodiscard]] std::variant<const proto::Envelope*, DecodeError> decode(
    std::string_view bytes, google::protobuf::Arena& arena);

// Parts of messages as values, and back. What is read has passed the checks of decode().

[[nodiscard]] inline bool is_of_worker(const proto::Envelope& message) {
  return message.from_worker_case() != proto::Envelope::FROM_WORKER_NOT_SET;
}

using Ranges = google::protobuf::RepeatedPtrField<proto::Range>;

[[nodiscard]] std::vector<RunRange> ranges_of(const Ranges& ranges);
void add_ranges(std::span<const RunRange> ranges, Ranges& message);

[[nodiscard]] RunRange runs_of(const proto::RunLease& lease);
[[nodiscard]] std::vector<RunIndex> runs_of(const proto::ResultAck& ack);

[[nodiscard]] ComputedRun computed_run(const proto::ComputedRun& message);
/// @param message  Is empty at first.
void write_run(const ComputedRun& computed, proto::ComputedRun& message);

/// Results as messages that a coordinator's socket takes, each of one campaign and attempt.
class ResultBatches {
 public:
  void add(const LeasedResult& result);
  /// Full ones first. @pre Is called once, at the end.
  [[nodiscard]] std::vector<proto::ResultBatch> take();

 private:
  struct Open {
    proto::ResultBatch batch;
    std::size_t size = 0;  ///< Of its results, bytes.
  };

  std::vector<proto::ResultBatch> full_;
  std::map<std::pair<CampaignId, Attempt>, Open> open_;
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
