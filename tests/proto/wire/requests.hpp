#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "proto/wire/client_codec.hpp"

namespace proofmass::test {

// Requests of clients.

/// What may be said of a submission besides its definition.
struct Wishes {
  std::optional<int> priority = {};
  std::optional<double> audit_fraction = {};
  std::string stop_rule = {};
  std::optional<std::uint64_t> failures_max = {};
};

inline proto::RequestEnvelope submission(const Definition& definition, const Wishes& wishes = {}) {
  proto::RequestEnvelope request;
  proto::SubmitRequest& content = *request.mutable_submit();
  wire::set_definition(definition, content);
  if (wishes.priority) content.set_priority(*wishes.priority);
  if (wishes.audit_fraction) content.set_audit_fraction(*wishes.audit_fraction);
  content.set_stop_rule(wishes.stop_rule);
  if (wishes.failures_max) content.set_failures_max(*wishes.failures_max);
  return request;
}

inline proto::RequestEnvelope control(proto::ControlAction action, const std::string& campaign,
                                      int priority = 0) {
  proto::RequestEnvelope request;
  proto::ControlRequest& content = *request.mutable_control();
  content.set_action(action);
  content.set_campaign(campaign);
  content.set_priority(priority);
  return request;
}

inline proto::RequestEnvelope release(const std::string& host) {
  proto::RequestEnvelope request;
  request.mutable_release_host()->set_host(host);
  return request;
}

inline proto::RequestEnvelope question(proto::Question question = proto::QUESTION_REPORT,
                                       const std::vector<std::string>& options = {},
                                       const std::string& statement = {}) {
  proto::RequestEnvelope request;
  proto::AnswerRequest& content = *request.mutable_answer();
  content.set_campaign("a");
  content.set_question(question);
  for (const std::string& option : options) content.add_options(option);
  content.set_statement(statement);
  return request;
}

inline proto::RequestEnvelope answer_part(std::uint64_t answer_id, std::uint64_t offset = 0) {
  proto::RequestEnvelope request;
  request.mutable_answer_part()->set_answer_id(answer_id);
  request.mutable_answer_part()->set_offset(offset);
  return request;
}

inline proto::RequestPart part(std::uint64_t total_size, std::uint64_t offset, std::string slice) {
  proto::RequestPart content;
  content.set_total_size(total_size);
  content.set_offset(offset);
  content.set_slice(std::move(slice));
  return content;
}

inline proto::RequestEnvelope request_of(proto::RequestPart part) {
  proto::RequestEnvelope request;
  *request.mutable_part() = std::move(part);
  return request;
}

/// @param interval_s  Between two reports.
inline proto::FactoryReport factory_report(
    const std::string& name, std::uint64_t interval_s,
    proto::FactoryPhase phase = proto::FACTORY_PHASE_ACTIVE) {
  proto::FactoryReport report;
  report.set_name(name);
  report.set_batch_system("pbs");
  report.set_phase(phase);
  report.set_interval_s(interval_s);
  return report;
}

inline proto::RequestEnvelope request_of(const proto::FactoryReport& report) {
  proto::RequestEnvelope request;
  *request.mutable_factory_report() = report;
  return request;
}

// Replies of coordinators.

inline proto::CampaignStatus campaign_status(
    const std::string& name, std::uint64_t num_done, std::uint64_t num_runs,
    proto::CampaignPhase phase = proto::CAMPAIGN_PHASE_ACTIVE) {
  proto::CampaignStatus campaign;
  campaign.set_name(name);
  campaign.set_phase(phase);
  campaign.set_num_runs(num_runs);
  campaign.set_num_done(num_done);
  return campaign;
}

/// One of each thing that it counts.
inline proto::StatusReply status_with(const std::vector<proto::CampaignStatus>& campaigns) {
  proto::StatusReply status;
  status.set_version("v");
  status.set_model_version("m");
  status.set_uptime_s(1.0);
  status.set_num_workers(1);
  status.set_num_slots(1);
  status.mutable_campaigns()->Assign(campaigns.begin(), campaigns.end());
  return status;
}

inline proto::ReplyEnvelope reply_with(const proto::StatusReply& status) {
  proto::ReplyEnvelope reply;
  *reply.mutable_status() = status;
  return reply;
}

inline proto::WorkerStatus worker_status(std::uint64_t id, const std::string& name,
                                         const std::string& host) {
  proto::WorkerStatus worker;
  worker.set_worker_id(id);
  worker.set_name(name);
  worker.set_host(host);
  return worker;
}

inline proto::ReplyEnvelope reply_with(const std::vector<proto::WorkerStatus>& workers) {
  proto::ReplyEnvelope reply;
  reply.mutable_workers()->mutable_workers()->Assign(workers.begin(), workers.end());
  return reply;
}

/// The reply to the request with this number.
template <typename Envelope>
Envelope numbered(std::uint64_t id, Envelope envelope) {
  envelope.set_request_id(id);
  return envelope;
}

}  // namespace proofmass::test
