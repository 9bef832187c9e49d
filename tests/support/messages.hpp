#pragma once

#include <google/protobuf/util/message_differencer.h>

#include <concepts>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/wire/codec.hpp"

namespace proofmass::proto {

template <std::derived_from<google::protobuf::Message> Content>
bool operator==(const Content& a, const Content& b) {
  return google::protobuf::util::MessageDifferencer::Equals(a, b);
}
template <std::derived_from<google::protobuf::Message> Content>
void PrintTo(const Content& content, std::ostream* out) {
  *out << content.ShortDebugString();
}

}  // namespace proofmass::proto

namespace proofmass::test {

/// The field of the envelope that holds messages of this type.
template <typename Content>
const google::protobuf::FieldDescriptor& field_of() {
  const auto* const fields = proto::Envelope::descriptor();
  for (int i = 0; i < fields->field_count(); ++i) {
    if (fields->field(i)->message_type() == Content::descriptor()) return *fields->field(i);
  }
  throw std::logic_error("no message of the envelope");
}

template <typename Content>
proto::Envelope in_envelope(Content content) {
  proto::Envelope envelope;
  auto* const field = envelope.GetReflection()->MutableMessage(&envelope, &field_of<Content>());
  dynamic_cast<Content&>(*field) = std::move(content);
  return envelope;
}

template <typename Content>
bool holds(const proto::Envelope& envelope) {
  return envelope.GetReflection()->HasField(envelope, &field_of<Content>());
}

/// @throws std::logic_error if the envelope holds another message.
template <typename Content>
Content content_of(const proto::Envelope& envelope) {
  if (!holds<Content>(envelope)) throw std::logic_error("other: " + envelope.ShortDebugString());
  const auto& field = envelope.GetReflection()->GetMessage(envelope, &field_of<Content>());
  return dynamic_cast<const Content&>(field);
}

template <typename Values>
auto vector_of(const Values& values) {
  return std::vector<typename Values::value_type>(values.begin(), values.end());
}

// Messages of their parts.

inline proto::Hello make_hello(std::string_view name, std::string_view host,
                               std::uint32_t num_slots, std::string_view model_version) {
  proto::Hello hello;
  hello.set_worker_name(std::string(name));
  hello.set_host(std::string(host));
  hello.set_process_id(1);
  hello.set_num_slots(num_slots);
  hello.set_model_version(std::string(model_version));
  hello.set_build("test");
  return hello;
}

/// A process that crashed.
inline proto::FormerSession make_former(wire::SessionId session,
                                        wire::LossReason reason = wire::LossReason::crashed) {
  proto::FormerSession former;
  former.set_session(session.value);
  former.set_reason(wire::message_value(reason));
  former.set_signal(11);
  return former;
}

inline proto::HeldRuns make_held(wire::CampaignId campaign, wire::Attempt attempt,
                                 const std::vector<RunRange>& ranges) {
  proto::HeldRuns held;
  held.set_campaign(campaign.value);
  held.set_attempt(attempt.value);
  wire::add_ranges(ranges, *held.mutable_ranges());
  return held;
}

inline proto::ComputedBatch make_computed_batch(wire::CampaignId campaign,
                                                const std::vector<RunRange>& ranges,
                                                std::uint32_t num_steps_done = 0) {
  proto::ComputedBatch batch;
  batch.set_campaign(campaign.value);
  batch.set_num_steps_done(num_steps_done);
  wire::add_ranges(ranges, *batch.mutable_ranges());
  return batch;
}

inline proto::Heartbeat make_heartbeat(std::uint32_t num_runs_max,
                                       const std::vector<proto::HeldRuns>& held = {},
                                       const std::vector<proto::ComputedBatch>& computing = {}) {
  proto::Heartbeat heartbeat;
  heartbeat.set_num_runs_max(num_runs_max);
  heartbeat.mutable_held()->Assign(held.begin(), held.end());
  heartbeat.mutable_computing()->Assign(computing.begin(), computing.end());
  return heartbeat;
}

inline proto::GiveBack make_give_back(wire::LossReason reason,
                                      const std::vector<proto::HeldRuns>& runs) {
  proto::GiveBack give_back;
  give_back.set_reason(wire::message_value(reason));
  give_back.mutable_runs()->Assign(runs.begin(), runs.end());
  return give_back;
}

inline proto::Bye make_bye(wire::LossReason reason = wire::LossReason::preempted) {
  proto::Bye bye;
  bye.set_reason(wire::message_value(reason));
  return bye;
}

inline proto::ResultBatch make_result_batch(wire::CampaignId campaign, wire::Attempt attempt,
                                            const std::vector<wire::ComputedRun>& results) {
  proto::ResultBatch batch;
  batch.set_campaign(campaign.value);
  batch.set_attempt(attempt.value);
  for (const wire::ComputedRun& result : results) wire::write_run(result, *batch.add_results());
  return batch;
}

inline proto::CampaignRequest make_request(wire::CampaignId campaign, std::uint64_t offset = 0) {
  proto::CampaignRequest request;
  request.set_campaign(campaign.value);
  request.set_offset(offset);
  return request;
}

inline proto::Welcome make_welcome(wire::WorkerId worker, double heartbeat_interval_s) {
  proto::Welcome welcome;
  welcome.set_worker_id(worker.value);
  welcome.set_heartbeat_interval_s(heartbeat_interval_s);
  return welcome;
}

inline proto::Reject make_reject(proto::RejectReason reason, const std::string& text = "") {
  return wire::rejection(reason, text).reject();
}

inline proto::RunLease make_lease(wire::CampaignId campaign, RunRange runs,
                                  wire::Attempt attempt = {1},
                                  const std::vector<double>& table_values = {}) {
  proto::RunLease lease;
  lease.set_campaign(campaign.value);
  lease.set_first_run(runs.first.value);
  lease.set_num_runs(static_cast<std::uint32_t>(runs.count));
  lease.set_attempt(attempt.value);
  lease.mutable_table_values()->Assign(table_values.begin(), table_values.end());
  return lease;
}

inline proto::DefinitionPart make_part(wire::CampaignId campaign, std::uint64_t offset,
                                       std::uint64_t total_size, std::uint64_t checksum,
                                       const std::string& content) {
  proto::DefinitionPart part;
  part.set_campaign(campaign.value);
  part.set_offset(offset);
  part.set_total_size(total_size);
  part.set_checksum(checksum);
  part.set_content(content);
  return part;
}

inline proto::Retract make_retract(wire::CampaignId campaign, const std::vector<RunRange>& ranges) {
  proto::Retract retract;
  retract.set_campaign(campaign.value);
  wire::add_ranges(ranges, *retract.mutable_ranges());
  return retract;
}

inline proto::NotServed make_not_served(wire::CampaignId campaign,
                                        const std::vector<RunRange>& ranges = {}) {
  proto::NotServed not_served;
  not_served.set_campaign(campaign.value);
  wire::add_ranges(ranges, *not_served.mutable_ranges());
  return not_served;
}

inline proto::Forget make_forget(wire::CampaignId campaign, std::uint64_t num_runs = num_runs_max) {
  proto::Forget forget;
  forget.set_campaign(campaign.value);
  forget.set_num_runs(num_runs);
  return forget;
}

inline proto::ResultAck make_ack(wire::CampaignId campaign, const std::vector<RunIndex>& runs) {
  proto::ResultAck ack;
  ack.set_campaign(campaign.value);
  for (const RunIndex run : runs) ack.add_runs(run.value);
  return ack;
}

}  // namespace proofmass::test
