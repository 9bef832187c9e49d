#include "proto/wire/client_codec.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.hpp"
#include "proto/client.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/definition_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

void write(const SubmitRequest& submit, proto::RequestEnvelope& envelope) {
  proto::SubmitRequest& message = *envelope.mutable_submit();
  detail::write_definition(submit.definition, *message.mutable_definition());
  if (submit.priority) message.set_priority(*submit.priority);
  if (submit.audit_fraction) message.set_audit_fraction(*submit.audit_fraction);
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
  message.set_priority(control.priority);
}

void write(const AnswerRequest& answer, proto::RequestEnvelope& envelope) {
  proto::AnswerRequest& message = *envelope.mutable_answer();
  message.set_campaign(answer.campaign);
  message.set_question(static_cast<proto::Question>(answer.question));
  for (const std::string& option : answer.options) message.add_options(option);
  message.set_statement(answer.statement);
  message.set_known_size(answer.known_size);
  message.set_known_sha256(answer.known_sha256);
}

void write(const AnswerPartRequest& part, proto::RequestEnvelope& envelope) {
  envelope.mutable_answer_part()->set_answer_id(part.answer_id);
  envelope.mutable_answer_part()->set_offset(part.offset);
}

/// The text, cut to what may be sent, with `?` for what may not.
std::string sendable(std::string_view text) {
  std::string result(text.substr(0, reply_text_size_max));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c != '\n' && (c < ' ' || c > '~'); }, '?');
  return result;
}

/// Of what a reply may say; 0 for what is none.
double sendable(double magnitude) {
  return std::isfinite(magnitude) && magnitude > 0.0 ? magnitude : 0.0;
}

void write_report(const FactoryReport& report, proto::FactoryReport& message) {
  message.set_name(name_from(report.name));
  message.set_batch_system(name_from(report.batch_system));
  message.set_phase(static_cast<proto::FactoryPhase>(report.phase));
  message.set_num_wanted(report.num_wanted);
  message.set_num_registered(report.num_registered);
  message.set_num_queued(report.num_queued);
  message.set_wait_s(sendable(report.wait_s));
  message.set_reason(sendable(report.reason));
  message.set_interval_s(report.interval_s);
}

void write(const FactoryReport& report, proto::RequestEnvelope& envelope) {
  write_report(report, *envelope.mutable_factory_report());
}

void write_factory(const FactoryStatus& factory, proto::FactoryStatus& message) {
  write_report(factory.report, *message.mutable_report());
  if (!factory.owner.empty()) message.set_owner(name_from(factory.owner));
  message.set_silent_s(sendable(factory.silent_s));
}

void write_campaign(const CampaignStatus& campaign, proto::CampaignStatus& message) {
  message.set_name(name_from(campaign.name));
  message.set_phase(static_cast<proto::CampaignPhase>(campaign.phase));
  message.set_priority(std::clamp(campaign.priority, -priority_max, priority_max));
  for (const CampaignCounter& counter : campaign_counters) {
    message.GetReflection()->SetUInt64(
        &message, detail::field_of(proto::CampaignStatus::descriptor(), counter.name),
        campaign.*counter.count);
  }
  const std::uint64_t num_runs = std::clamp<std::uint64_t>(campaign.num_runs, 1, num_runs_max);
  const std::uint64_t num_given_up = std::min(campaign.num_given_up, num_runs);
  message.set_num_runs(num_runs);
  message.set_num_given_up(num_given_up);
  message.set_num_done(std::min(campaign.num_done, num_runs - num_given_up));
  message.set_rate_hz(sendable(campaign.rate_hz));
  if (campaign.remaining_s) message.set_remaining_s(sendable(*campaign.remaining_s));
  message.set_storage_failure(sendable(campaign.storage_failure));
  if (!campaign.owner.empty()) message.set_owner(name_from(campaign.owner));
}

void write(const StatusReply& status, proto::ReplyEnvelope& envelope) {
  proto::StatusReply& message = *envelope.mutable_status();
  message.set_version(status.version);
  message.set_model_version(status.model_version);
  message.set_uptime_s(sendable(status.uptime_s));
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
  for (const std::string& host : status.quarantined_hosts) {
    message.add_quarantined_hosts(name_from(host));
  }
  message.set_num_quarantined_hosts(status.num_quarantined_hosts);
  for (const FactoryStatus& factory : status.factories) {
    write_factory(factory, *message.add_factories());
  }
}

void write_worker(const WorkerStatus& worker, proto::WorkerStatus& message) {
  message.set_worker_id(worker.id.value);
  message.set_name(name_from(worker.name));
  message.set_host(name_from(worker.host));
  message.set_process_id(worker.process_id);
  message.set_num_slots(worker.num_slots);
  message.set_num_lent(worker.num_lent);
  message.set_num_results(worker.num_results);
  message.set_silent_s(sendable(worker.silent_s));
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

void write(const AnswerReply& answer, proto::ReplyEnvelope& envelope) {
  proto::AnswerReply& message = *envelope.mutable_answer();
  message.set_answer_id(answer.answer_id);
  message.set_size(answer.size);
  message.set_sha256(answer.sha256);
  message.set_offset(answer.offset);
  message.set_exit_code(static_cast<std::uint32_t>(answer.exit_code));
  message.set_error_text(sendable(answer.error_text));
}

void write(const AnswerPartReply& part, proto::ReplyEnvelope& envelope) {
  envelope.mutable_answer_part()->set_content(part.content);
}

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
