#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/error.hpp"
#include "core/model_rules.hpp"
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

int checked_priority(int priority) {
  require(priority >= -priority_max && priority <= priority_max, "priority",
          fmt::format("{}", priority),
          fmt::format("must be in [{}, {}]", -priority_max, priority_max));
  return priority;
}

/// @param maximum  The largest enumerator; 0 says that there is none.
template <typename Sent>
Sent checked_enumerator(Sent sent, Sent maximum, std::string_view field) {
  require(sent >= 1 && sent <= maximum, field, fmt::format("{}", static_cast<int>(sent)),
          fmt::format("must be in [1, {}]", static_cast<int>(maximum)));
  return sent;
}

void check(const proto::SubmitRequest& message) {
  const double fraction = message.audit_fraction();
  require(fraction >= 0.0 && fraction <= 1.0, "audit", fmt::format("{}", fraction),
          "must be in [0, 1]");
  detail::check_definition(message.definition());
  const std::string& rule = message.stop_rule();
  require(rule.size() <= stop_rule_size_max, "until", fmt::format("{} bytes", rule.size()),
          fmt::format("must be at most {}", stop_rule_size_max));
  if (!rule.empty()) (void)parse_stop_rule(rule);
  (void)checked_priority(message.priority());
  require_in(message.failures_max(), 0, num_runs_max, "failures");
}

void check(const proto::ControlRequest& message) {
  (void)checked_enumerator(message.action(), proto::ControlAction_MAX, "action");
  (void)checked_name(message.campaign(), "campaign");
  (void)checked_priority(message.priority());
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
  (void)checked_enumerator(message.question(), proto::Question_MAX, "question");
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

std::string checked_text(const std::string& text, std::string_view field) {
  require(text.size() <= reply_text_size_max, field, fmt::format("{} bytes", text.size()),
          fmt::format("must be at most {}", reply_text_size_max));
  // It goes to a terminal.
  require(std::all_of(text.begin(), text.end(), may_be_in_text), field,
          fmt::format("{} bytes", text.size()), "must be printable ASCII and line ends");
  return text;
}

std::string checked_owner(const std::string& owner) {
  return owner.empty() ? "" : checked_name(owner, "owner");
}

}  // namespace

FactoryReport read(const proto::FactoryReport& message) {
  require_in(message.interval_s(), 1, factory_interval_s_max, "interval_s");
  return {.name = checked_name(message.name(), "name"),
          .batch_system = checked_name(message.batch_system(), "batch_system"),
          .phase = static_cast<FactoryPhase>(
              checked_enumerator(message.phase(), proto::FactoryPhase_MAX, "phase")),
          .num_wanted = message.num_wanted(),
          .num_registered = message.num_registered(),
          .num_queued = message.num_queued(),
          .wait_s = checked_magnitude(message.wait_s(), "wait_s"),
          .reason = checked_text(message.reason(), "reason"),
          .interval_s = message.interval_s()};
}

namespace {

FactoryStatus read_factory(const proto::FactoryStatus& message) {
  return {.report = read(message.report()),
          .owner = checked_owner(message.owner()),
          .silent_s = checked_magnitude(message.silent_s(), "silent_s")};
}

std::optional<double> remaining_time(const proto::CampaignStatus& message) {
  if (!message.has_remaining_s()) return std::nullopt;
  return checked_magnitude(message.remaining_s(), "remaining_s");
}

CampaignStatus read_campaign(const proto::CampaignStatus& message) {
  require_in(message.num_runs(), 1, num_runs_max, "num_runs");
  require_in(message.num_given_up(), 0, message.num_runs(), "num_given_up");
  require_in(message.num_done(), 0, message.num_runs() - message.num_given_up(), "num_done");
  CampaignStatus campaign{
      .name = checked_name(message.name(), "name"),
      .phase = static_cast<CampaignPhase>(
          checked_enumerator(message.phase(), proto::CampaignPhase_MAX, "phase")),
      .priority = checked_priority(message.priority()),
      .rate_hz = checked_magnitude(message.rate_hz(), "rate_hz"),
      .remaining_s = remaining_time(message),
      .storage_failure = checked_text(message.storage_failure(), "storage_failure"),
      .owner = checked_owner(message.owner())};
  for (const CampaignCounter& counter : campaign_counters) {
    campaign.*counter.count = message.GetReflection()->GetUInt64(
        message, detail::field_of(proto::CampaignStatus::descriptor(), counter.name));
  }
  return campaign;
}

void read_lists(const proto::StatusReply& message, StatusReply& status) {
  require_count(message.unserved_files_size(), 0, unserved_files_per_reply_max, "unserved_files");
  require_count(message.quarantined_hosts_size(), 0, quarantined_hosts_per_reply_max,
                "quarantined_hosts");
  for (const auto& file : message.unserved_files()) {
    status.unserved_files.push_back({.file = checked_text(file.file(), "file"),
                                     .reason = checked_text(file.reason(), "reason")});
  }
  for (const std::string& host : message.quarantined_hosts()) {
    status.quarantined_hosts.push_back(checked_name(host, "quarantined_hosts"));
  }
  require_count(message.factories_size(), 0, factories_max, "factories");
  for (const auto& factory : message.factories()) {
    status.factories.push_back(read_factory(factory));
  }
}

}  // namespace

StatusReply read(const proto::StatusReply& message) {
  require_count(message.campaigns_size(), 0, campaigns_per_reply_max, "campaigns");
  StatusReply status{.version = checked_name(message.version(), "version"),
                     .model_version = checked_name(message.model_version(), "model_version"),
                     .uptime_s = checked_magnitude(message.uptime_s(), "uptime_s"),
                     .num_workers = message.num_workers(),
                     .num_slots = message.num_slots(),
                     .campaigns = {},
                     .num_campaigns = message.num_campaigns(),
                     .num_unserved_files = message.num_unserved_files(),
                     .num_quarantined_hosts = message.num_quarantined_hosts()};
  for (const auto& campaign : message.campaigns()) {
    status.campaigns.push_back(read_campaign(campaign));
  }
  read_lists(message, status);
  return status;
}

namespace {

WorkerStatus read_worker(const proto::WorkerStatus& message) {
  return {.id = {detail::checked_id(message.worker_id(), "worker_id")},
          .name = checked_name(message.name(), "name"),
          .host = checked_name(message.host(), "host"),
          .process_id = message.process_id(),
          .num_slots = message.num_slots(),
          .num_lent = message.num_lent(),
          .num_results = message.num_results(),
          .silent_s = checked_magnitude(message.silent_s(), "silent_s"),
          .is_quarantined = message.is_quarantined()};
}

}  // namespace

WorkersReply read(const proto::WorkersReply& message) {
  require_count(message.workers_size(), 0, workers_per_reply_max, "workers");
  WorkersReply reply{.workers = {}, .num_workers = message.num_workers()};
  for (const auto& worker : message.workers()) reply.workers.push_back(read_worker(worker));
  return reply;
}

namespace {

void check(const proto::AnswerReply& message) {
  require_in(message.offset(), 0, message.size(), "offset");
  require_in(message.exit_code(), 0, 255, "exit_code");
  (void)detail::checked_id(message.answer_id(), "answer_id");
  check_sha256(message.sha256(), "sha256");
  (void)checked_text(message.error_text(), "error_text");
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
      return (void)read(envelope.factory_report());
    case proto::RequestEnvelope::REQUEST_NOT_SET:
      break;
  }
  PROOFMASS_EXPECT(false);
}

void check(const proto::ReplyEnvelope& envelope) {
  switch (envelope.reply_case()) {
    case proto::ReplyEnvelope::kStatus:
      return (void)read(envelope.status());
    case proto::ReplyEnvelope::kWorkers:
      return (void)read(envelope.workers());
    case proto::ReplyEnvelope::kDone:
      return (void)checked_text(envelope.done().text(), "text");
    case proto::ReplyEnvelope::kError:
      return (void)checked_text(envelope.error().text(), "text");
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
