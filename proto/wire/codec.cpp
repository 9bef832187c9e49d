#include "proto/wire/codec.hpp"

#include <fmt/format.h>
#include <google/protobuf/arena.h>

#include <array>
#include <cstddef>

#include "core/error.hpp"
#include "core/model.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/message_reader.hpp"

namespace proofmass::wire {
namespace {

/// The largest batch of results has 40,000.
constexpr std::size_t fields_max = 65536;

/// An envelope in an arena. The parts of a message, of which a batch of results has hundreds, are
/// freed at once; those of a short message need no memory but this object.
class EnvelopeArena {
 public:
  [[nodiscard]] proto::Envelope& envelope() { return envelope_; }

 private:
  alignas(std::max_align_t) std::array<char, 2048> first_block_;
  google::protobuf::Arena arena_{first_block_.data(), first_block_.size()};
  proto::Envelope& envelope_ = *google::protobuf::Arena::CreateMessage<proto::Envelope>(&arena_);
};

bool has_few_fields(std::string_view bytes) {
  // A field takes two bytes or more, so that a short message cannot have too many. Counting takes
  // as long as parsing.
  return bytes.size() / 2 <= fields_max ||
         detail::has_fields_at_most(bytes, *proto::Envelope::descriptor(), fields_max);
}

DecodeError too_large(std::size_t size, std::size_t size_max) {
  return {DecodeFault::too_large,
          fmt::format("message size = {} bytes (must be at most {})", size, size_max)};
}

DecodeError wrong_version(std::uint32_t version) {
  return {DecodeFault::wrong_version,
          fmt::format("protocol_version = {} (must be {})", version, protocol_version)};
}

Packet read_packet(const proto::Envelope& envelope) {
  return {.header = {.session = {detail::checked_id(envelope.session(), "session")},
                     .epoch = {envelope.epoch()},
                     .sequence = envelope.sequence()},
          .message = detail::read_message(envelope)};
}

template <typename Ranges>
void write_ranges(const std::vector<RunRange>& ranges, Ranges& messages) {
  for (const RunRange& range : ranges) {
    proto::Range& message = *messages.Add();
    message.set_first(range.first.value);
    message.set_count(range.count);
  }
}

void write_held(const HeldRuns& held, proto::HeldRuns& message) {
  message.set_campaign(held.campaign.value);
  message.set_attempt(held.attempt.value);
  write_ranges(held.ranges, *message.mutable_ranges());
}

void write(const Hello& hello, proto::Envelope& envelope) {
  proto::Hello& message = *envelope.mutable_hello();
  message.set_worker_name(hello.worker_name);
  message.set_host(hello.host);
  message.set_process_id(hello.process_id);
  message.set_num_slots(hello.num_slots);
  message.set_model_version(hello.model_version);
  message.set_build(hello.build);
  message.set_reference_digest(hello.reference_digest);
  if (!hello.former) return;
  message.mutable_former()->set_session(hello.former->session.value);
  message.mutable_former()->set_reason(static_cast<proto::LossReason>(hello.former->reason));
  message.mutable_former()->set_signal(hello.former->signal);
}

void write(const Welcome& welcome, proto::Envelope& envelope) {
  proto::Welcome& message = *envelope.mutable_welcome();
  message.set_worker_id(welcome.worker.value);
  message.set_heartbeat_interval_s(welcome.heartbeat_interval_s);
}

void write(const Reject& reject, proto::Envelope& envelope) {
  envelope.mutable_reject()->set_reason(static_cast<proto::RejectReason>(reject.reason));
  envelope.mutable_reject()->set_text(reject.text);
}

void write(const CampaignRequest& request, proto::Envelope& envelope) {
  envelope.mutable_campaign_request()->set_campaign(request.campaign.value);
  envelope.mutable_campaign_request()->set_offset(request.offset);
}

void write(const DefinitionPart& part, proto::Envelope& envelope) {
  proto::DefinitionPart& message = *envelope.mutable_definition_part();
  message.set_campaign(part.campaign.value);
  message.set_offset(part.offset);
  message.set_total_size(part.total_size);
  message.set_checksum(part.checksum);
  message.set_content(part.content);
}

void write(const Forget& forget, proto::Envelope& envelope) {
  envelope.mutable_forget()->set_campaign(forget.campaign.value);
  envelope.mutable_forget()->set_num_runs(forget.num_runs);
}

void write(const NotServed& not_served, proto::Envelope& envelope) {
  envelope.mutable_not_served()->set_campaign(not_served.campaign.value);
  write_ranges(not_served.ranges, *envelope.mutable_not_served()->mutable_ranges());
}

void write(const RunLease& lease, proto::Envelope& envelope) {
  proto::RunLease& message = *envelope.mutable_run_lease();
  message.set_campaign(lease.campaign.value);
  message.set_first_run(lease.runs.first.value);
  message.set_num_runs(static_cast<std::uint32_t>(lease.runs.count));
  message.set_attempt(lease.attempt.value);
  message.set_is_alone(lease.is_alone);
  message.set_batch_runs_max(lease.batch_runs_max);
  message.mutable_table_values()->Assign(lease.table_values.begin(), lease.table_values.end());
}

void write(const Retract& retract, proto::Envelope& envelope) {
  envelope.mutable_retract()->set_campaign(retract.campaign.value);
  write_ranges(retract.ranges, *envelope.mutable_retract()->mutable_ranges());
}

void write(const GiveBack& give_back, proto::Envelope& envelope) {
  proto::GiveBack& message = *envelope.mutable_give_back();
  message.set_reason(static_cast<proto::LossReason>(give_back.reason));
  for (const HeldRuns& held : give_back.runs) write_held(held, *message.add_runs());
}

void write_run(const ComputedRun& computed, proto::ComputedRun& message) {
  const RunResult& result = computed.result;
  message.set_run(result.run.value);
  message.set_status(static_cast<proto::RunStatus>(result.status));
  message.set_num_draws(result.num_draws);
  message.set_num_rounds(result.num_rounds);
  if (result.has_truth()) {
    message.mutable_truth()->Assign(result.truth.begin(), result.truth.end());
    // What was simulated has health; the message has it whenever the status allows it.
    std::vector<double> health = result.health;
    health.resize(model().results().health.size());
    message.mutable_health()->Assign(health.begin(), health.end());
  }
  if (result.has_estimate()) {
    message.mutable_estimate()->Assign(result.estimate.begin(), result.estimate.end());
    message.mutable_standard_error()->Assign(result.standard_error.begin(),
                                             result.standard_error.end());
  }
  message.set_loss_cause(result.loss.cause);
  message.set_loss_session(result.loss.session);
  message.set_compute_s(computed.compute_s);
  message.set_elapsed_s(computed.elapsed_s);
}

void write(const ResultBatch& batch, proto::Envelope& envelope) {
  proto::ResultBatch& message = *envelope.mutable_result_batch();
  message.set_campaign(batch.campaign.value);
  message.set_attempt(batch.attempt.value);
  for (const ComputedRun& computed : batch.results) write_run(computed, *message.add_results());
}

void write(const ResultAck& ack, proto::Envelope& envelope) {
  envelope.mutable_result_ack()->set_campaign(ack.campaign.value);
  for (const RunIndex run : ack.runs) envelope.mutable_result_ack()->add_runs(run.value);
}

void write(const Heartbeat& heartbeat, proto::Envelope& envelope) {
  proto::Heartbeat& message = *envelope.mutable_heartbeat();
  message.set_num_runs_max(heartbeat.num_runs_max);
  message.set_num_steps_done(heartbeat.num_steps_done);
  for (const HeldRuns& held : heartbeat.held) write_held(held, *message.add_held());
  for (const ComputedBatch& batch : heartbeat.computing) {
    proto::ComputedBatch& content = *message.add_computing();
    content.set_campaign(batch.campaign.value);
    content.set_num_steps_done(batch.num_steps_done);
    write_ranges(batch.ranges, *content.mutable_ranges());
  }
  for (const HeldRuns& held : heartbeat.set_aside) write_held(held, *message.add_set_aside());
}

void write(const Bye& bye, proto::Envelope& envelope) {
  envelope.mutable_bye()->set_reason(static_cast<proto::LossReason>(bye.reason));
}

void write(const HeartbeatAck&, proto::Envelope& envelope) { envelope.mutable_heartbeat_ack(); }
void write(const Drain&, proto::Envelope& envelope) { envelope.mutable_drain(); }
void write(const Stop&, proto::Envelope& envelope) { envelope.mutable_stop(); }

}  // namespace

std::variant<Packet, DecodeError> decode(std::string_view bytes) {
  detail::silence_protobuf();
  if (bytes.size() > message_size_max) return too_large(bytes.size(), message_size_max);
  EnvelopeArena arena;
  proto::Envelope& envelope = arena.envelope();
  const bool is_parsed = has_few_fields(bytes) &&
                         envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!is_parsed) {
    return DecodeError{DecodeFault::unparsable,
                       fmt::format("message = {} bytes (must be an envelope of at most {} fields)",
                                   bytes.size(), fields_max)};
  }
  if (envelope.protocol_version() != protocol_version) {
    return wrong_version(envelope.protocol_version());
  }
  if (envelope.message_case() == proto::Envelope::MESSAGE_NOT_SET) {
    return DecodeError{DecodeFault::empty, "message = none (must be of a known kind)"};
  }
  try {
    return read_packet(envelope);
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, detail::printable(error.what())};
  }
}

std::string encode(const Packet& packet) {
  EnvelopeArena arena;
  proto::Envelope& envelope = arena.envelope();
  envelope.set_protocol_version(protocol_version);
  envelope.set_session(packet.header.session.value);
  envelope.set_epoch(packet.header.epoch.value);
  envelope.set_sequence(packet.header.sequence);
  std::visit([&](const auto& content) { write(content, envelope); }, packet.message);
  if (envelope.ByteSizeLong() > message_size_max) {
    throw InvalidArgument(fmt::format("message size = {} bytes (must be at most {})",
                                      envelope.ByteSizeLong(), message_size_max));
  }
  return envelope.SerializeAsString();
}

}  // namespace proofmass::wire
