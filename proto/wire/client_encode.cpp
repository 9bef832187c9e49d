#include <fmt/format.h>

#include <algorithm>

#include "core/error.hpp"
#include "proto/client.pb.h"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/definition_message.hpp"

namespace proofmass::wire {
namespace {

void write(const SubmitRequest& submit, proto::RequestEnvelope& envelope) {
  proto::SubmitRequest& message = *envelope.mutable_submit();
  detail::write_definition(submit.definition, *message.mutable_definition());
  message.set_priority(submit.priority);
  message.set_audit_fraction(submit.audit_fraction);
  message.set_stop_rule(submit.stop_rule);
  if (submit.failures_max) message.set_failures_max(*submit.failures_max);
}

void write(const StatusRequest& status, proto::RequestEnvelope& envelope) {
  envelope.mutable_status()->set_first_campaign(status.first_campaign);
}

void write(const WorkersRequest& workers, proto::RequestEnvelope& envelope) {
  envelope.mutable_workers()->set_after_worker_id(workers.after_worker_id);
}

void write(const ReleaseHostRequest& release, proto::RequestEnvelope& envelope) {
  envelope.mutable_release_host()->set_host(release.host);
}

void write(const RequestPart& part, proto::RequestEnvelope& envelope) {
  proto::RequestPart& message = *envelope.mutable_part();
  message.set_total_size(part.total_size);
  message.set_offset(part.offset);
  message.set_slice(part.slice);
}

void write(const ControlRequest& control, proto::RequestEnvelope& envelope) {
  proto::ControlRequest& message = *envelope.mutable_control();
  message.set_action(static_cast<proto::ControlAction>(control.action));
  message.set_campaign(control.campaign);
}

/// The text, cut to what may be sent, with `?` for what may not.
std::string sendable(std::string_view text) {
  std::string result(text.substr(0, reply_text_size_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c != '\n' && (c < ' ' || c > '~'); }, '?');
  return result;
}

void write_campaign(const CampaignStatus& campaign, proto::CampaignStatus& message) {
  message.set_name(campaign.name);
  message.set_phase(static_cast<proto::CampaignPhase>(campaign.phase));
  message.set_priority(campaign.priority);
  message.set_num_runs(campaign.num_runs);
  message.set_num_done(campaign.num_done);
  message.set_num_without_estimate(campaign.num_without_estimate);
  message.set_num_given_up(campaign.num_given_up);
  message.set_num_lent(campaign.num_lent);
  message.set_num_duplicates(campaign.num_duplicates);
  message.set_num_audited(campaign.num_audited);
  message.set_num_mismatches(campaign.num_mismatches);
  message.set_rate_hz(campaign.rate_hz);
  if (campaign.remaining_s) message.set_remaining_s(*campaign.remaining_s);
  message.set_storage_failure(sendable(campaign.storage_failure));
  message.set_owner(campaign.owner);
}

void write(const StatusReply& status, proto::ReplyEnvelope& envelope) {
  proto::StatusReply& message = *envelope.mutable_status();
  message.set_version(status.version);
  message.set_model_version(status.model_version);
  message.set_uptime_s(status.uptime_s);
  message.set_num_workers(status.num_workers);
  message.set_num_slots(status.num_slots);
  for (const CampaignStatus& campaign : status.campaigns) {
    write_campaign(campaign, *message.add_campaigns());
  }
  message.set_num_campaigns(status.num_campaigns);
  for (const UnservedFile& file : status.unserved_files) {
    proto::UnservedFile& unserved = *message.add_unserved_files();
    unserved.set_file(sendable(file.file));
    unserved.set_reason(sendable(file.reason));
  }
  message.set_num_unserved_files(status.num_unserved_files);
  for (const std::string& host : status.quarantined_hosts) message.add_quarantined_hosts(host);
  message.set_num_quarantined_hosts(status.num_quarantined_hosts);
}

void write_worker(const WorkerStatus& worker, proto::WorkerStatus& message) {
  message.set_worker_id(worker.id.value);
  message.set_name(worker.name);
  message.set_host(worker.host);
  message.set_process_id(worker.process_id);
  message.set_num_slots(worker.num_slots);
  message.set_num_lent(worker.num_lent);
  message.set_num_results(worker.num_results);
  message.set_silent_s(worker.silent_s);
  message.set_is_quarantined(worker.is_quarantined);
}

void write(const WorkersReply& reply, proto::ReplyEnvelope& envelope) {
  proto::WorkersReply& message = *envelope.mutable_workers();
  for (const WorkerStatus& worker : reply.workers) write_worker(worker, *message.add_workers());
  message.set_num_workers(reply.num_workers);
}

void write(const DoneReply& done, proto::ReplyEnvelope& envelope) {
  envelope.mutable_done()->set_text(sendable(done.text));
}

void write(const ErrorReply& error, proto::ReplyEnvelope& envelope) {
  envelope.mutable_error()->set_text(sendable(error.text));
}

void write(const PartReply& part, proto::ReplyEnvelope& envelope) {
  envelope.mutable_part()->set_next_offset(part.next_offset);
}

void write(const WaitReply&, proto::ReplyEnvelope& envelope) { envelope.mutable_wait(); }

std::size_t size_max_of(const ClientRequest& request) {
  if (std::holds_alternative<SubmitRequest>(request)) return submit_size_max;
  if (std::holds_alternative<RequestPart>(request)) return request_message_size_max;
  return request_size_max;
}

template <typename Envelope>
std::string bytes_of(const Envelope& envelope, std::string_view what, std::size_t size_max) {
  const std::size_t size = envelope.ByteSizeLong();
  if (size > size_max) {
    throw InvalidArgument(
        fmt::format("{} size = {} bytes (must be at most {})", what, size, size_max));
  }
  return envelope.SerializeAsString();
}

}  // namespace

std::string encode(const RequestPacket& packet) {
  proto::RequestEnvelope envelope;
  envelope.set_protocol_version(protocol_version);
  envelope.set_request_id(packet.id);
  std::visit([&](const auto& content) { write(content, envelope); }, packet.request);
  return bytes_of(envelope, "request", size_max_of(packet.request));
}

std::string encode(const ReplyPacket& packet) {
  proto::ReplyEnvelope envelope;
  envelope.set_protocol_version(protocol_version);
  envelope.set_request_id(packet.id);
  std::visit([&](const auto& content) { write(content, envelope); }, packet.reply);
  return bytes_of(envelope, "reply", reply_size_max);
}

}  // namespace proofmass::wire
