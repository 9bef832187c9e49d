#include "proto/wire/client_codec.hpp"

#include <algorithm>
#include <utility>

#include "core/error.hpp"
#include "proto/wire/checks.hpp"
#include "proto/wire/definition_codec.hpp"

namespace proofmass::wire {
namespace {

void cut_counts(proto::CampaignStatus& campaign) {
  campaign.set_priority(std::clamp(campaign.priority(), -priority_max, priority_max));
  const std::uint64_t num_runs = std::clamp<std::uint64_t>(campaign.num_runs(), 1, num_runs_max);
  const std::uint64_t num_given_up = std::min(campaign.num_given_up(), num_runs);
  campaign.set_num_runs(num_runs);
  campaign.set_num_given_up(num_given_up);
  campaign.set_num_done(std::min(campaign.num_done(), num_runs - num_given_up));
}

/// A reply with 4096 workers has 37,000.
constexpr std::size_t envelope_fields_max = std::size_t{1} << 16;

detail::Form request_form(std::size_t size_max) {
  return {.name = "request",
          .kind = "an envelope",
          .size_max = size_max,
          .fields_max = envelope_fields_max};
}

constexpr detail::Form reply_form{.name = "reply",
                                  .kind = "an envelope",
                                  .size_max = reply_size_max,
                                  .fields_max = envelope_fields_max};

}  // namespace

std::string encode(proto::RequestEnvelope request) {
  if (request.has_factory_report()) detail::make_sendable(*request.mutable_factory_report());
  return detail::envelope_bytes(request, request_form(size_max_of(request)));
}

std::string encode(proto::ReplyEnvelope reply) {
  detail::make_sendable(reply);
  if (reply.has_status()) {
    for (auto& campaign : *reply.mutable_status()->mutable_campaigns()) cut_counts(campaign);
  }
  return detail::envelope_bytes(reply, reply_form);
}

std::size_t size_max_of(const proto::RequestEnvelope& envelope) {
  if (envelope.has_submit()) return submit_size_max;
  return envelope.has_part() ? request_message_size_max : request_size_max;
}

std::variant<proto::RequestEnvelope, DecodeError> decode_request(std::string_view bytes) {
  proto::RequestEnvelope envelope;
  auto fault = detail::parse(bytes, request_form(submit_size_max), envelope);
  const std::size_t size_max = size_max_of(envelope);
  if (!fault && bytes.size() > size_max) {
    fault = detail::too_large(request_form(size_max), bytes.size());
  }
  if (!fault) fault = detail::fault_in(envelope);
  if (fault) return *std::move(fault);
  return envelope;
}

std::variant<proto::ReplyEnvelope, DecodeError> decode_reply(std::string_view bytes) {
  proto::ReplyEnvelope envelope;
  auto fault = detail::parse(bytes, reply_form, envelope);
  if (!fault) fault = detail::fault_in(envelope);
  if (fault) return *std::move(fault);
  return envelope;
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
