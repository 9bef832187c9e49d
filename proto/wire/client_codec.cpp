#include "proto/wire/client_codec.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.hpp"
#include "proto/wire/checks.hpp"
#include "proto/wire/definition_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

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

}  // namespace

void write(const FactoryReport& report, proto::FactoryReport& message) {
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

namespace {

void write_factory(const FactoryStatus& factory, proto::FactoryStatus& message) {
  write(factory.report, *message.mutable_report());
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

}  // namespace

void write(const StatusReply& status, proto::StatusReply& message) {
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

namespace {

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

}  // namespace

void write(const WorkersReply& reply, proto::WorkersReply& message) {
  for (const WorkerStatus& worker : reply.workers) write_worker(worker, *message.add_workers());
  message.set_num_workers(reply.num_workers);
}

namespace {

void make_sendable(std::string& text) { text = sendable(std::string_view(text)); }

/// Texts of the messages that are not written by write().
void make_sendable(proto::ReplyEnvelope& reply) {
  if (reply.has_done()) make_sendable(*reply.mutable_done()->mutable_text());
  if (reply.has_error()) make_sendable(*reply.mutable_error()->mutable_text());
  if (reply.has_answer()) make_sendable(*reply.mutable_answer()->mutable_error_text());
}

template <typename Envelope>
std::string bytes_of(Envelope& envelope, std::string_view what, std::size_t size_max) {
  envelope.set_protocol_version(protocol_version);
  const std::size_t size = envelope.ByteSizeLong();
  if (size > size_max) {
    throw InvalidArgument(
        fmt::format("{} size = {} bytes (must be at most {})", what, size, size_max));
  }
  return envelope.SerializeAsString();
}

}  // namespace

std::string encode(proto::RequestEnvelope request) {
  return bytes_of(request, "request", size_max_of(request));
}

std::string encode(proto::ReplyEnvelope reply) {
  make_sendable(reply);
  return bytes_of(reply, "reply", reply_size_max);
}

void set_definition(const Definition& definition, proto::SubmitRequest& request) {
  detail::write_definition(definition, *request.mutable_definition());
}

Definition take_definition(proto::SubmitRequest& request) {
  Definition definition = detail::read_definition(request.definition());
  request.clear_definition();
  return definition;
}

proto::ReplyEnvelope done_reply(std::string text) {
  proto::ReplyEnvelope reply;
  reply.mutable_done()->set_text(std::move(text));
  return reply;
}

proto::ReplyEnvelope error_reply(std::string text) {
  proto::ReplyEnvelope reply;
  reply.mutable_error()->set_text(std::move(text));
  return reply;
}

}  // namespace proofmass::wire
