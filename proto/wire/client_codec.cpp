#include "proto/wire/client_codec.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
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

using detail::require;
using detail::require_count;
using detail::require_in;
using detail::require_magnitude;
using detail::require_name;

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

void check_priority(int priority) {
  require(priority >= -priority_max && priority <= priority_max, "priority",
          fmt::format("{}", priority),
          fmt::format("must be in [{}, {}]", -priority_max, priority_max));
}

/// @param maximum  The largest enumerator; 0 says that there is none.
void check_enumerator(int sent, int maximum, std::string_view field) {
  require(sent >= 1 && sent <= maximum, field, fmt::format("{}", sent),
          fmt::format("must be in [1, {}]", maximum));
}

void check(const proto::SubmitRequest& message) {
  const double fraction = message.audit_fraction();
  require(fraction >= 0.0 && fraction <= 1.0, "audit", fmt::format("{}", fraction),
          "must be in [0, 1]");
  detail::check_definition(message.definition());
  require_in(message.model_description().size(), 0, definition_text_size_max,
             "model_description size");
  const std::string& rule = message.stop_rule();
  require(rule.size() <= stop_rule_size_max, "until", fmt::format("{} bytes", rule.size()),
          fmt::format("must be at most {}", stop_rule_size_max));
  check_priority(message.priority());
  require_in(message.failures_max(), 0, num_runs_max, "failures");
}

void check(const proto::ControlRequest& message) {
  check_enumerator(message.action(), proto::ControlAction_MAX, "action");
  require_name(message.campaign(), "campaign");
  check_priority(message.priority());
}

void check(const proto::RequestPart& message) {
  require_in(message.total_size(), 1, submit_size_max, "total_size");
  require_in(message.slice().size(), 1, request_part_size_max, "slice size");
  require_in(message.offset(), 0, message.total_size() - 1, "offset");
  require_in(message.slice().size(), 1, message.total_size() - message.offset(), "slice size");
}

void check_sha256(const std::string& text, std::string_view field) {
  const bool is_one = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == text.npos;
  require(is_one, field, fmt::format("{} bytes", text.size()), "must be 64 hexadecimal digits");
}

/// It becomes an argument of a program, which ends at a zero byte.
void check_argument(const std::string& text, std::size_t size_max, std::string_view field) {
  require_in(text.size(), 1, size_max, field);
  require(text.find('\0') == text.npos, field, fmt::format("{} bytes", text.size()),
          "must not have a zero byte");
}

void check(const proto::AnswerRequest& message) {
  require_name(message.campaign(), "campaign");
  check_enumerator(message.question(), proto::Question_MAX, "question");
  require_count(message.options_size(), 0, answer_options_max, "options");
  for (const std::string& option : message.options()) {
    check_argument(option, answer_option_size_max, "option size");
  }
  if (message.question() == proto::QUESTION_QUERY) {
    check_argument(message.statement(), statement_size_max, "statement size");
  }
  if (message.known_size() > 0) check_sha256(message.known_sha256(), "known_sha256");
}

bool may_be_in_text(char c) { return c == '\n' || (c >= ' ' && c <= '~'); }

void check_text(const std::string& text, std::string_view field) {
  require(text.size() <= reply_text_size_max, field, fmt::format("{} bytes", text.size()),
          fmt::format("must be at most {}", reply_text_size_max));
  // It goes to a terminal.
  require(std::all_of(text.begin(), text.end(), may_be_in_text), field,
          fmt::format("{} bytes", text.size()), "must be printable ASCII and line ends");
}

void check_owner(const std::string& owner) {
  if (!owner.empty()) require_name(owner, "owner");
}

void check(const proto::FactoryReport& message) {
  require_in(message.interval_s(), 1, factory_interval_s_max, "interval_s");
  require_name(message.name(), "name");
  require_name(message.batch_system(), "batch_system");
  check_enumerator(message.phase(), proto::FactoryPhase_MAX, "phase");
  require_magnitude(message.wait_s(), "wait_s");
  check_text(message.reason(), "reason");
}

void check(const proto::FactoryStatus& message) {
  check(message.report());
  check_owner(message.owner());
  require_magnitude(message.silent_s(), "silent_s");
}

void check(const proto::CampaignStatus& message) {
  require_in(message.num_runs(), 1, num_runs_max, "num_runs");
  require_in(message.num_given_up(), 0, message.num_runs(), "num_given_up");
  require_in(message.num_done(), 0, message.num_runs() - message.num_given_up(), "num_done");
  require_name(message.name(), "name");
  check_enumerator(message.phase(), proto::CampaignPhase_MAX, "phase");
  check_priority(message.priority());
  require_magnitude(message.rate_hz(), "rate_hz");
  require_magnitude(message.remaining_s(), "remaining_s");
  check_text(message.storage_failure(), "storage_failure");
  check_text(message.model_refusal(), "model_refusal");
  if (!message.missing_model().empty()) {
    require_name(message.missing_model(), "missing_model");
  }
  if (!message.model_version().empty()) {
    require_name(message.model_version(), "model_version");
  }
  check_owner(message.owner());
}

void check(const proto::StatusReply& message) {
  require_count(message.campaigns_size(), 0, campaigns_per_reply_max, "campaigns");
  require_count(message.unserved_files_size(), 0, unserved_files_per_reply_max, "unserved_files");
  require_count(message.quarantined_hosts_size(), 0, quarantined_hosts_per_reply_max,
                "quarantined_hosts");
  require_count(message.factories_size(), 0, factories_max, "factories");
  require_name(message.version(), "version");
  require_name(message.model_version(), "model_version");
  require_magnitude(message.uptime_s(), "uptime_s");
  for (const proto::CampaignStatus& campaign : message.campaigns()) check(campaign);
  for (const proto::UnservedFile& file : message.unserved_files()) {
    check_text(file.file(), "file");
    check_text(file.reason(), "reason");
  }
  for (const std::string& host : message.quarantined_hosts()) {
    require_name(host, "quarantined_hosts");
  }
  for (const proto::FactoryStatus& factory : message.factories()) check(factory);
  check_text(message.last_refusal(), "last_refusal");
  require_magnitude(message.last_refusal_s(), "last_refusal_s");
}

void check(const proto::WorkersReply& message) {
  require_count(message.workers_size(), 0, workers_per_reply_max, "workers");
  for (const proto::WorkerStatus& worker : message.workers()) {
    detail::require_id(worker.worker_id(), "worker_id");
    require_name(worker.name(), "name");
    require_name(worker.host(), "host");
    require_magnitude(worker.silent_s(), "silent_s");
    detail::require_cards(worker.cards());
    require_magnitude(worker.card_rate_hz(), "card_rate_hz");
  }
}

void check(const proto::AnswerReply& message) {
  require_in(message.offset(), 0, message.size(), "offset");
  require_in(message.exit_code(), 0, 255, "exit_code");
  detail::require_id(message.answer_id(), "answer_id");
  check_sha256(message.sha256(), "sha256");
  check_text(message.error_text(), "error_text");
}

void check(const proto::RequestEnvelope& envelope) {
  detail::require_id(envelope.request_id(), "request_id");
  switch (envelope.request_case()) {
    case proto::RequestEnvelope::kSubmit:
      return check(envelope.submit());
    case proto::RequestEnvelope::kStatus:
    case proto::RequestEnvelope::kWorkers:
      return;
    case proto::RequestEnvelope::kControl:
      return check(envelope.control());
    case proto::RequestEnvelope::kPart:
      return check(envelope.part());
    case proto::RequestEnvelope::kReleaseHost:
      return require_name(envelope.release_host().host(), "host");
    case proto::RequestEnvelope::kAnswer:
      return check(envelope.answer());
    case proto::RequestEnvelope::kAnswerPart:
      return detail::require_id(envelope.answer_part().answer_id(), "answer_id");
    case proto::RequestEnvelope::kFactoryReport:
      return check(envelope.factory_report());
    case proto::RequestEnvelope::REQUEST_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

void check(const proto::ReplyEnvelope& envelope) {
  switch (envelope.reply_case()) {
    case proto::ReplyEnvelope::kStatus:
      return check(envelope.status());
    case proto::ReplyEnvelope::kWorkers:
      return check(envelope.workers());
    case proto::ReplyEnvelope::kDone:
      return check_text(envelope.done().text(), "text");
    case proto::ReplyEnvelope::kError:
      return check_text(envelope.error().text(), "text");
    case proto::ReplyEnvelope::kPart:
    case proto::ReplyEnvelope::kWait:
      return;
    case proto::ReplyEnvelope::kAnswer:
      return check(envelope.answer());
    case proto::ReplyEnvelope::kAnswerPart:
      return require_in(envelope.answer_part().content().size(), 0, answer_part_size_max,
                        "content size");
    case proto::ReplyEnvelope::REPLY_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

}  // namespace

std::string encode(proto::RequestEnvelope request) {
  if (request.has_factory_report()) make_sendable(*request.mutable_factory_report());
  return detail::envelope_bytes(request, request_form(size_max_of(request)));
}

std::string encode(proto::ReplyEnvelope reply) {
  make_sendable(reply);
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
  const detail::Form form = request_form(submit_size_max);
  const auto fault = detail::read(bytes, form, envelope, [&]() -> std::optional<DecodeError> {
    const bool is_empty = envelope.request_case() == proto::RequestEnvelope::REQUEST_NOT_SET;
    const auto found = detail::fault_of_envelope(form, envelope.protocol_version(), is_empty);
    if (found) return found;
    const std::size_t size_max = size_max_of(envelope);
    if (bytes.size() > size_max) return detail::too_large(request_form(size_max), bytes.size());
    check(envelope);
    return std::nullopt;
  });
  if (fault) return *fault;
  return envelope;
}

std::variant<proto::ReplyEnvelope, DecodeError> decode_reply(std::string_view bytes) {
  proto::ReplyEnvelope envelope;
  const auto fault = detail::read(bytes, reply_form, envelope, [&]() -> std::optional<DecodeError> {
    const bool is_empty = envelope.reply_case() == proto::ReplyEnvelope::REPLY_NOT_SET;
    const auto found = detail::fault_of_envelope(reply_form, envelope.protocol_version(), is_empty);
    if (found) return found;
    check(envelope);
    return std::nullopt;
  });
  if (fault) return *fault;
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
