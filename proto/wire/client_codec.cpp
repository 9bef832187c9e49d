#include "proto/wire/client_codec.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/error.hpp"
#include "proto/wire/checks.hpp"
#include "proto/wire/definition_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire {
namespace {

using Field = google::protobuf::FieldDescriptor;

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

/// Fields whose rule is that of names.
constexpr std::array<std::string_view, 5> name_fields{"name", "host", "batch_system", "owner",
                                                      "quarantined_hosts"};

std::string sendable(std::string_view text, const Field& field) {
  if (std::ranges::find(name_fields, std::string_view(field.name())) == name_fields.end()) {
    return sendable(text);
  }
  return text.empty() && field.name() == "owner" ? "" : name_from(text);
}

void make_sendable(google::protobuf::Message& message);

void make_field_sendable(google::protobuf::Message& message, const Field& field) {
  const google::protobuf::Reflection& values = *message.GetReflection();
  const int count = field.is_repeated() ? values.FieldSize(message, &field) : 0;
  if (field.type() == Field::TYPE_STRING) {
    if (!field.is_repeated()) {
      return values.SetString(&message, &field, sendable(values.GetString(message, &field), field));
    }
    for (int i = 0; i < count; ++i) {
      values.SetRepeatedString(&message, &field, i,
                               sendable(values.GetRepeatedString(message, &field, i), field));
    }
  } else if (field.type() == Field::TYPE_MESSAGE) {
    if (!field.is_repeated() && values.HasField(message, &field)) {
      make_sendable(*values.MutableMessage(&message, &field));
    }
    for (int i = 0; i < count; ++i) {
      make_sendable(*values.MutableRepeatedMessage(&message, &field, i));
    }
  } else if (field.type() == Field::TYPE_DOUBLE && values.HasField(message, &field)) {
    values.SetDouble(&message, &field, sendable(values.GetDouble(message, &field)));
  }
}

/// Applies sendable() to every text and double of a message and of the messages in it. Fields of
/// bytes stay as they are.
void make_sendable(google::protobuf::Message& message) {
  const google::protobuf::Descriptor& type = *message.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) make_field_sendable(message, *type.field(i));
}

void cut_counts(proto::CampaignStatus& campaign) {
  campaign.set_priority(std::clamp(campaign.priority(), -priority_max, priority_max));
  const std::uint64_t num_runs = std::clamp<std::uint64_t>(campaign.num_runs(), 1, num_runs_max);
  const std::uint64_t num_given_up = std::min(campaign.num_given_up(), num_runs);
  campaign.set_num_runs(num_runs);
  campaign.set_num_given_up(num_given_up);
  campaign.set_num_done(std::min(campaign.num_done(), num_runs - num_given_up));
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
  if (request.has_factory_report()) make_sendable(*request.mutable_factory_report());
  return bytes_of(request, "request", size_max_of(request));
}

std::string encode(proto::ReplyEnvelope reply) {
  make_sendable(reply);
  if (reply.has_status()) {
    for (auto& campaign : *reply.mutable_status()->mutable_campaigns()) cut_counts(campaign);
  }
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
