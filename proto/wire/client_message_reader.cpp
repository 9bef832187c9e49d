#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/error.hpp"
#include "proto/wire/checks.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/definition_codec.hpp"

namespace proofmass::wire {
namespace {

using detail::checked_magnitude;
using detail::checked_name;
using detail::require;
using detail::require_count;
using detail::require_in;

/// A reply with 4096 workers has 37,000.
constexpr std::size_t request_fields_max = std::size_t{1} << 16;

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
  (void)checked_name(message.campaign(), "campaign");
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
  (void)checked_name(message.campaign(), "campaign");
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
  if (!owner.empty()) (void)checked_name(owner, "owner");
}

void check(const proto::FactoryReport& message) {
  require_in(message.interval_s(), 1, factory_interval_s_max, "interval_s");
  (void)checked_name(message.name(), "name");
  (void)checked_name(message.batch_system(), "batch_system");
  check_enumerator(message.phase(), proto::FactoryPhase_MAX, "phase");
  (void)checked_magnitude(message.wait_s(), "wait_s");
  check_text(message.reason(), "reason");
}

void check(const proto::FactoryStatus& message) {
  check(message.report());
  check_owner(message.owner());
  (void)checked_magnitude(message.silent_s(), "silent_s");
}

void check(const proto::CampaignStatus& message) {
  require_in(message.num_runs(), 1, num_runs_max, "num_runs");
  require_in(message.num_given_up(), 0, message.num_runs(), "num_given_up");
  require_in(message.num_done(), 0, message.num_runs() - message.num_given_up(), "num_done");
  (void)checked_name(message.name(), "name");
  check_enumerator(message.phase(), proto::CampaignPhase_MAX, "phase");
  check_priority(message.priority());
  (void)checked_magnitude(message.rate_hz(), "rate_hz");
  (void)checked_magnitude(message.remaining_s(), "remaining_s");
  check_text(message.storage_failure(), "storage_failure");
  if (!message.missing_model().empty()) {
    (void)checked_name(message.missing_model(), "missing_model");
  }
  if (!message.model_version().empty()) {
    (void)checked_name(message.model_version(), "model_version");
  }
  check_owner(message.owner());
}

void check(const proto::StatusReply& message) {
  require_count(message.campaigns_size(), 0, campaigns_per_reply_max, "campaigns");
  require_count(message.unserved_files_size(), 0, unserved_files_per_reply_max, "unserved_files");
  require_count(message.quarantined_hosts_size(), 0, quarantined_hosts_per_reply_max,
                "quarantined_hosts");
  require_count(message.factories_size(), 0, factories_max, "factories");
  (void)checked_name(message.version(), "version");
  (void)checked_name(message.model_version(), "model_version");
  (void)checked_magnitude(message.uptime_s(), "uptime_s");
  for (const proto::CampaignStatus& campaign : message.campaigns()) check(campaign);
  for (const proto::UnservedFile& file : message.unserved_files()) {
    check_text(file.file(), "file");
    check_text(file.reason(), "reason");
  }
  for (const std::string& host : message.quarantined_hosts()) {
    (void)checked_name(host, "quarantined_hosts");
  }
  for (const proto::FactoryStatus& factory : message.factories()) check(factory);
  check_text(message.last_refusal(), "last_refusal");
  (void)checked_magnitude(message.last_refusal_s(), "last_refusal_s");
}

void check(const proto::WorkersReply& message) {
  require_count(message.workers_size(), 0, workers_per_reply_max, "workers");
  for (const proto::WorkerStatus& worker : message.workers()) {
    (void)detail::checked_id(worker.worker_id(), "worker_id");
    (void)checked_name(worker.name(), "name");
    (void)checked_name(worker.host(), "host");
    (void)checked_magnitude(worker.silent_s(), "silent_s");
    detail::require_cards(worker.cards());
    (void)checked_magnitude(worker.card_rate_hz(), "card_rate_hz");
  }
}

void check(const proto::AnswerReply& message) {
  require_in(message.offset(), 0, message.size(), "offset");
  require_in(message.exit_code(), 0, 255, "exit_code");
  (void)detail::checked_id(message.answer_id(), "answer_id");
  check_sha256(message.sha256(), "sha256");
  check_text(message.error_text(), "error_text");
}

void check(const proto::RequestEnvelope& envelope) {
  (void)detail::checked_id(envelope.request_id(), "request_id");
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
      return (void)checked_name(envelope.release_host().host(), "host");
    case proto::RequestEnvelope::kAnswer:
      return check(envelope.answer());
    case proto::RequestEnvelope::kAnswerPart:
      return (void)detail::checked_id(envelope.answer_part().answer_id(), "answer_id");
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

DecodeError fault(DecodeFault kind, std::string text) { return {kind, std::move(text)}; }

DecodeError too_large(std::string_view what, std::size_t size, std::size_t size_max) {
  return fault(DecodeFault::too_large,
               fmt::format("{} size = {} bytes (must be at most {})", what, size, size_max));
}

/// What is wrong with the bytes before the content is looked at, if anything is.
template <typename Envelope>
std::optional<DecodeError> parse(std::string_view bytes, std::string_view what,
                                 std::size_t size_max, Envelope& envelope) {
  detail::silence_protobuf();
  if (bytes.size() > size_max) return too_large(what, bytes.size(), size_max);
  const bool is_parsed =
      detail::has_fields_at_most(bytes, *Envelope::descriptor(), request_fields_max) &&
      envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!is_parsed) {
    return fault(DecodeFault::unparsable,
                 fmt::format("{} = {} bytes (must be an envelope of at most {} fields)", what,
                             bytes.size(), request_fields_max));
  }
  if (envelope.protocol_version() != protocol_version) {
    return fault(DecodeFault::wrong_version,
                 fmt::format("protocol_version = {} (must be {})", envelope.protocol_version(),
                             protocol_version));
  }
  return std::nullopt;
}

/// What follows of it if it parses and has content.
template <typename Envelope>
std::variant<Envelope, DecodeError> checked(Envelope envelope) {
  try {
    check(envelope);
    return envelope;
  } catch (const Error& error) {
    return fault(DecodeFault::invalid, detail::printable(error.what()));
  }
}

DecodeError empty(std::string_view what) {
  return fault(DecodeFault::empty, fmt::format("{} = none (must be of a known kind)", what));
}

}  // namespace

std::size_t size_max_of(const proto::RequestEnvelope& envelope) {
  if (envelope.has_submit()) return submit_size_max;
  return envelope.has_part() ? request_message_size_max : request_size_max;
}

std::variant<proto::RequestEnvelope, DecodeError> decode_request(std::string_view bytes) {
  proto::RequestEnvelope envelope;
  if (const auto error = parse(bytes, "request", submit_size_max, envelope)) return *error;
  if (envelope.request_case() == proto::RequestEnvelope::REQUEST_NOT_SET) return empty("request");
  const std::size_t size_max = size_max_of(envelope);
  if (bytes.size() > size_max) return too_large("request", bytes.size(), size_max);
  return checked(std::move(envelope));
}

std::variant<proto::ReplyEnvelope, DecodeError> decode_reply(std::string_view bytes) {
  proto::ReplyEnvelope envelope;
  if (const auto error = parse(bytes, "reply", reply_size_max, envelope)) return *error;
  if (envelope.reply_case() == proto::ReplyEnvelope::REPLY_NOT_SET) return empty("reply");
  return checked(std::move(envelope));
}

}  // namespace proofmass::wire
