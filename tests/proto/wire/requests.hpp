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

inline proto::RequestEnvelope control(wire::ControlAction action, const std::string& campaign,
                                      int priority = 0) {
  proto::RequestEnvelope request;
  proto::ControlRequest& content = *request.mutable_control();
  content.set_action(static_cast<proto::ControlAction>(action));
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

inline proto::RequestEnvelope request_of(const wire::FactoryReport& report) {
  proto::RequestEnvelope request;
  wire::write(report, *request.mutable_factory_report());
  return request;
}

// Replies of coordinators.

inline proto::ReplyEnvelope reply_with(const wire::StatusReply& status) {
  proto::ReplyEnvelope reply;
  wire::write(status, *reply.mutable_status());
  return reply;
}

inline proto::ReplyEnvelope reply_with(const wire::WorkersReply& workers) {
  proto::ReplyEnvelope reply;
  wire::write(workers, *reply.mutable_workers());
  return reply;
}

/// The reply to the request with this number.
template <typename Envelope>
Envelope numbered(std::uint64_t id, Envelope envelope) {
  envelope.set_request_id(id);
  return envelope;
}

}  // namespace proofmass::test
