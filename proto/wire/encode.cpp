#include <fmt/format.h>

#include "core/error.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/campaign_codec.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::wire {
namespace {

void write(const Hello& hello, proto::Envelope& envelope) {
  proto::Hello& message = *envelope.mutable_hello();
  message.set_worker_name(hello.worker_name);
  message.set_host(hello.host);
  message.set_process_id(hello.process_id);
  message.set_num_slots(hello.num_slots);
  message.set_model_version(hello.model_version);
}

void write(const Welcome& welcome, proto::Envelope& envelope) {
  PROOFMASS_EXPECT(welcome.campaign != nullptr);
  proto::Welcome& message = *envelope.mutable_welcome();
  message.set_worker_id(welcome.worker.value);
  message.set_heartbeat_interval_s(welcome.heartbeat_interval_s);
  detail::encode_campaign(*welcome.campaign, *message.mutable_campaign());
}

void write(const Reject& reject, proto::Envelope& envelope) {
  envelope.mutable_reject()->set_reason(static_cast<proto::RejectReason>(reject.reason));
  envelope.mutable_reject()->set_text(reject.text);
}

void write(const Credit& credit, proto::Envelope& envelope) {
  envelope.mutable_credit()->set_num_runs_max(credit.num_runs_max);
}

void write(const RunLease& lease, proto::Envelope& envelope) {
  proto::RunLease& message = *envelope.mutable_run_lease();
  message.set_lease_id(lease.lease.value);
  message.set_first_run(lease.runs.first.value);
  message.set_num_runs(static_cast<std::uint32_t>(lease.runs.count));
  message.set_attempt(lease.attempt.value);
  message.mutable_table_values()->Assign(lease.table_values.begin(), lease.table_values.end());
}

void write_run(const ComputedRun& computed, proto::ComputedRun& message) {
  const RunResult& result = computed.result;
  message.set_run(result.run.value);
  message.set_status(static_cast<proto::RunStatus>(result.status));
  message.set_num_draws(result.num_draws);
  message.set_num_rounds(result.num_rounds);
  if (result.has_truth()) {
    message.mutable_truth()->Assign(result.truth.begin(), result.truth.end());
  }
  if (result.has_estimate()) {
    message.mutable_estimate()->Assign(result.estimate.begin(), result.estimate.end());
  }
  message.set_compute_s(computed.compute_s);
}

void write(const ResultBatch& batch, proto::Envelope& envelope) {
  proto::ResultBatch& message = *envelope.mutable_result_batch();
  message.set_lease_id(batch.lease.value);
  message.set_attempt(batch.attempt.value);
  for (const ComputedRun& computed : batch.results) write_run(computed, *message.add_results());
}

void write(const ResultAck& ack, proto::Envelope& envelope) {
  for (const RunIndex run : ack.runs) envelope.mutable_result_ack()->add_runs(run.value);
}

void write(const Heartbeat& heartbeat, proto::Envelope& envelope) {
  proto::Heartbeat& message = *envelope.mutable_heartbeat();
  message.set_num_orbits_done(heartbeat.num_orbits_done);
  for (const LeaseId lease : heartbeat.leases) message.add_lease_ids(lease.value);
}

void write(const HeartbeatAck&, proto::Envelope& envelope) { envelope.mutable_heartbeat_ack(); }
void write(const Bye&, proto::Envelope& envelope) { envelope.mutable_bye(); }
void write(const Drain&, proto::Envelope& envelope) { envelope.mutable_drain(); }
void write(const Stop&, proto::Envelope& envelope) { envelope.mutable_stop(); }

}  // namespace

std::string encode(const Message& message) {
  proto::Envelope envelope;
  envelope.set_protocol_version(protocol_version);
  std::visit([&](const auto& content) { write(content, envelope); }, message);
  const std::size_t size_max =
      std::holds_alternative<Welcome>(message) ? welcome_size_max : message_size_max;
  if (envelope.ByteSizeLong() > size_max) {
    throw InvalidArgument(fmt::format("message size = {} bytes (must be at most {})",
                                      envelope.ByteSizeLong(), size_max));
  }
  return envelope.SerializeAsString();
}

}  // namespace proofmass::wire
