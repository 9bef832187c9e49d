#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/reflection.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <type_traits>
#include <vector>

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/client.pb.h"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/messages.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::wire::detail {
namespace {

using Base = google::protobuf::Message;
using Field = google::protobuf::FieldDescriptor;
using google::protobuf::Descriptor;

enum Kind : std::uint8_t {
  bounded,     ///< A number, bytes of a text or entries of a list: from `least` to `most`.
  identifier,  ///< A number that is not 0, or a name; of a list, `most` of them at most.
  name_or_none,
  text,        ///< At most so many bytes of printable ASCII and line ends: it goes to a terminal.
  short_text,  ///< At most so many bytes.
  cards,       ///< At most so many bytes of printable ASCII.
  magnitude,   ///< A number that is finite and not negative.
  fraction,    ///< A number from 0 to 1.
  finite,      ///< A list of such numbers.
  one_of,      ///< An enumerator whose bit is in `most`.
  related,     ///< What it may be follows from other fields: see require_related().
};

struct Rule {
  std::string_view field;  ///< Of any message, or of one: `Hello.num_slots`.
  Kind kind = bounded;
  std::uint64_t least = 0;
  std::uint64_t most = 0;
  std::string_view called = {};  ///< In texts; by its own name if empty.
};

constexpr std::uint64_t bit(LossReason reason) { return 1ULL << static_cast<unsigned>(reason); }

/// Others: a text is a name, an enumerator not 0, a number with a fraction finite and not negative.
/// A list of messages has at most ranges_per_message_max, and integers may be any.
constexpr auto rules = std::to_array<Rule>({
    {"attempt", identifier},
    {"campaign", identifier},
    {"cards", cards, 0, cards_text_size_max},
    {"other_models", bounded, 0, other_models_max},
    {"ranges", bounded, 1, ranges_per_message_max},
    {"results", bounded, 1, runs_per_lease_max},
    {"session", identifier},
    {"worker_id", identifier},
    {"Bye.reason", one_of, 0,
     bit(LossReason::drained) | bit(LossReason::walltime) | bit(LossReason::preempted) |
         bit(LossReason::failed)},
    {"CampaignRequest.offset", bounded, 0, definition_size_max - 1},
    {"ComputedRun.run", bounded, 0, num_runs_max - 1},
    {"DefinitionPart.content", related},
    {"DefinitionPart.total_size", bounded, 1, definition_size_max},
    {"Forget.num_runs", bounded, 1, num_runs_max},
    {"FormerSession.reason", one_of, 0,
     bit(LossReason::crashed) | bit(LossReason::out_of_memory) | bit(LossReason::preempted)},
    {"FormerSession.session", identifier, 0, 0, "former session"},
    {"FormerSession.signal", bounded, 0, signal_max, "former signal"},
    {"GiveBack.reason", one_of, 0,
     bit(LossReason::crashed) | bit(LossReason::retracted) | bit(LossReason::drained) |
         bit(LossReason::walltime) | bit(LossReason::preempted) | bit(LossReason::failed)},
    {"GiveBack.runs", bounded, 1, ranges_per_message_max},
    {"Heartbeat.num_runs_max", bounded, 0, runs_held_max},
    {"Hello.num_slots", bounded, 1, slots_max},
    {"NotServed.ranges", bounded, 0, ranges_per_message_max},
    {"OtherModel.version", identifier, 0, 0, "other_models.version"},
    {"Range.count", bounded, 1, num_runs_max, "range count"},
    {"Reject.reason", bounded, 1, proto::RejectReason_MAX},
    {"Reject.text", short_text, 0, reject_text_size_max},
    {"ResultAck.runs", bounded, 1, runs_per_lease_max},
    {"RunLease.num_runs", bounded, 1, runs_per_lease_max},
    {"Welcome.heartbeat_interval_s", related},
    {"DataTable.key", identifier, 0, 0, "definition.tables.key"},
    {"DataTable.num_columns", bounded, 1, columns_of_a_table_max, "definition.tables.num_columns"},
    {"DataTable.values", finite, 0, 0, "definition.tables.values"},
    {"Definition.model_version", name_or_none, 0, 0, "definition.model_version"},
    {"Definition.table_columns", bounded, 0, table_columns_max, "definition.table_columns"},
    {"Definition.tables", bounded, 0, definition_tables_max, "definition.tables"},
    {"Definition.text", bounded, 1, definition_text_size_max, "definition.text"},
    {"TableColumn.values", finite, 0, 0, "definition.table_columns.values"},
    {"answer_id", identifier},
    {"campaigns", bounded, 0, campaigns_per_reply_max},
    {"error_text", text, 0, reply_text_size_max},
    {"factories", bounded, 0, factories_max},
    {"file", text, 0, reply_text_size_max},
    {"last_refusal", text, 0, reply_text_size_max},
    {"missing_model", name_or_none},
    {"model_refusal", text, 0, reply_text_size_max},
    {"owner", name_or_none},
    {"priority", bounded, 0, priority_max},
    {"quarantined_hosts", identifier, 0, quarantined_hosts_per_reply_max},
    {"reason", text, 0, reply_text_size_max},
    {"storage_failure", text, 0, reply_text_size_max},
    {"text", text, 0, reply_text_size_max},
    {"unserved_files", bounded, 0, unserved_files_per_reply_max},
    {"workers", bounded, 0, workers_per_reply_max},
    {"AnswerPartReply.content", bounded, 0, answer_part_size_max},
    {"AnswerReply.exit_code", bounded, 0, 255},
    {"AnswerReply.sha256", related},
    {"AnswerRequest.known_sha256", related},
    {"AnswerRequest.options", bounded, 0, answer_options_max},
    {"AnswerRequest.statement", related},
    {"CampaignStatus.model_version", name_or_none},
    {"CampaignStatus.num_runs", bounded, 1, num_runs_max},
    {"FactoryReport.interval_s", bounded, 1, factory_interval_s_max},
    {"RequestEnvelope.request_id", identifier},
    {"RequestPart.slice", bounded, 1, request_part_size_max},
    {"RequestPart.total_size", bounded, 1, submit_size_max},
    {"SubmitRequest.audit_fraction", fraction, 0, 0, "audit"},
    {"SubmitRequest.failures_max", bounded, 0, num_runs_max, "failures"},
    {"SubmitRequest.model_description", bounded, 0, definition_text_size_max},
    {"SubmitRequest.stop_rule", short_text, 0, stop_rule_size_max, "until"},
});

// What rules require. Texts are made for a refusal only: a batch of results asks thousands of
// times.

void require(bool condition, std::string_view field, const std::string& value,
             std::string_view rule) {
  if (!condition) throw ConfigError(field, value, rule);
}

template <typename Number>
void require_in(Number value, std::type_identity_t<Number> least, std::type_identity_t<Number> most,
                std::string_view field, std::string_view unit = "") {
  if (value >= least && value <= most) return;
  throw ConfigError(field, fmt::format("{}{}", value, unit),
                    fmt::format("must be in [{}, {}]", least, most));
}

void require_magnitude(double value, std::string_view field,
                       double most = std::numeric_limits<double>::max()) {
  if (value >= 0.0 && value <= most) return;
  const bool is_too_large = value > most && std::isfinite(value);
  throw ConfigError(field, fmt::format("{}", value),
                    is_too_large ? fmt::format("must be <= {}", most) : "must be >= 0");
}

// What follows from several fields. Each has obeyed its own rule before.

void require_related(const proto::Range& range) {
  require_in(range.first(), 0, num_runs_max - range.count(), "range first");
}

void require_related(const proto::Hello& hello) {
  require_in(hello.num_card_slots(), 0, hello.num_slots() - 1, "num_card_slots");
  require_in(hello.slots_per_thread(), 0, hello.num_slots() - hello.num_card_slots(),
             "slots_per_thread");
}

void require_related(const proto::Welcome& welcome) {
  const double interval_s = welcome.heartbeat_interval_s();
  require(interval_s > 0.0 && interval_s <= heartbeat_interval_s_max, "heartbeat_interval_s",
          fmt::format("{}", interval_s),
          fmt::format("must be in (0, {}]", heartbeat_interval_s_max));
}

void require_related(const proto::DefinitionPart& part) {
  require_in(part.content().size(), 1,
             std::min<std::uint64_t>(definition_part_size_max, part.total_size()), "content size");
  require_in(part.offset(), 0, part.total_size() - part.content().size(), "offset");
}

void require_related(const proto::RunLease& lease) {
  require_in(lease.first_run(), 0, num_runs_max - lease.num_runs(), "first_run");
  const auto& values = lease.table_values();
  const auto num_values = static_cast<std::uint64_t>(values.size());
  require(num_values % lease.num_runs() == 0 && num_values / lease.num_runs() <= table_columns_max,
          "table_values", fmt::format("{} entries", num_values),
          fmt::format("must be the same number for each run, at most {}", table_columns_max));
  const bool all_finite = std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
  require(all_finite, "table_values", "not finite", "must be finite");
}

/// Of all lists together.
template <typename... Lists>
void require_few_ranges(const Lists&... lists) {
  int count = 0;
  const auto add = [&](const auto& list) {
    for (const auto& item : list) count += item.ranges_size();
  };
  (add(lists), ...);
  require_in(count, 0, int{ranges_per_message_max}, "number of ranges");
}

void require_related(const proto::GiveBack& message) { require_few_ranges(message.runs()); }

void require_related(const proto::Heartbeat& heartbeat) {
  require_few_ranges(heartbeat.held(), heartbeat.set_aside());
  require_few_ranges(heartbeat.computing());
}

/// Values in range; none if they have no meaning. How many there are depends on the campaign, see
/// broken_size_rules().
void require_values(const google::protobuf::RepeatedField<double>& values, bool have_meaning,
                    double least, double most, std::string_view field) {
  require(have_meaning || values.empty(), field, fmt::format("{} entries", values.size()),
          "must be 0 with this status");
  for (const double value : values) require_in(value, least, most, field);
}

void require_related(const proto::ComputedRun& run) {
  RunResult result;
  result.status = static_cast<RunStatus>(run.status());
  const bool has_truth = result.has_truth();
  const bool has_estimate = result.has_estimate();
  const bool has_errors = has_estimate && run.standard_error_size() > 0;
  const bool is_lost = result.status == RunStatus::lost;
  const std::uint32_t position_max = is_lost ? 255 : 0;
  require_values(run.truth(), has_truth, -magnitude_max, magnitude_max, "truth");
  require_values(run.estimate(), has_estimate, -magnitude_max, magnitude_max, "estimate");
  require_values(run.standard_error(), has_estimate, -magnitude_max, magnitude_max,
                 "standard_error");
  require_values(run.health(), has_truth, 0.0, magnitude_max, "health");
  require_values(run.fit(), has_errors, 0.0, magnitude_max, "fit");
  require_values(run.correlation(), has_errors, -1.0, 1.0, "correlation");
  require_in(run.loss_cause(), is_lost ? 1 : 0, position_max, "loss_cause");
  require_in(run.loss_session(), is_lost ? 1 : 0, position_max, "loss_session");
  require_magnitude(run.compute_s(), "compute_s", run_time_s_max);
  require_magnitude(run.elapsed_s(), "elapsed_s", run_time_s_max);
}

void require_related(const proto::ResultAck& ack) {
  for (const std::uint64_t run : ack.runs()) require_in(run, 0, num_runs_max - 1, "run");
}

void require_related(const proto::DataTable& table) {
  const auto size = static_cast<std::uint64_t>(table.values_size());
  require(size % table.num_columns() == 0, "definition.tables.values",
          fmt::format("{} entries", size), fmt::format("must be rows of {}", table.num_columns()));
}

void require_related(const proto::RequestPart& part) {
  require_in(part.offset(), 0, part.total_size() - 1, "offset");
  require_in(part.slice().size(), 1, part.total_size() - part.offset(), "slice size");
}

void require_sha256(const std::string& text, std::string_view field) {
  const bool is_one = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == text.npos;
  require(is_one, field, fmt::format("{} bytes", text.size()), "must be 64 hexadecimal digits");
}

/// It becomes an argument of a program, which ends at a zero byte.
void require_argument(const std::string& text, std::size_t size_max, std::string_view field) {
  require_in(text.size(), 1, size_max, field);
  require(text.find('\0') == text.npos, field, fmt::format("{} bytes", text.size()),
          "must not have a zero byte");
}

void require_related(const proto::AnswerRequest& request) {
  for (const std::string& option : request.options()) {
    require_argument(option, answer_option_size_max, "option size");
  }
  if (request.question() == proto::QUESTION_QUERY) {
    require_argument(request.statement(), statement_size_max, "statement size");
  }
  if (request.known_size() > 0) require_sha256(request.known_sha256(), "known_sha256");
}

void require_related(const proto::AnswerReply& reply) {
  require_in(reply.offset(), 0, reply.size(), "offset");
  require_sha256(reply.sha256(), "sha256");
}

void require_related(const proto::CampaignStatus& campaign) {
  require_in(campaign.num_given_up(), 0, campaign.num_runs(), "num_given_up");
  require_in(campaign.num_done(), 0, campaign.num_runs() - campaign.num_given_up(), "num_done");
}

// The rules of each type of message, found once.

struct TypeRules;

struct FieldRule {
  const Field* field;
  Rule rule;
  const TypeRules* content;  ///< Of the messages that it holds.
};

struct TypeRules {
  std::vector<FieldRule> fields;  ///< That have a rule, in the order of their declaration.
  void (*require_related)(const Base&) = nullptr;  ///< Null if there is nothing more.
};

Rule rule_for(const Field& field) {
  const std::string in_message = field.containing_type()->name() + "." + field.name();
  for (const std::string& name : {in_message, field.name()}) {
    const auto* const found = std::ranges::find(rules, name, &Rule::field);
    if (found != rules.end()) return *found;
  }
  if (const auto* const type = field.enum_type()) {
    return {field.name(), bounded, 1, static_cast<std::uint64_t>(type->value_count() - 1)};
  }
  if (field.cpp_type() == Field::CPPTYPE_DOUBLE && !field.is_repeated()) {
    return {field.name(), magnitude};
  }
  if (field.cpp_type() == Field::CPPTYPE_STRING) return {field.name(), identifier};
  if (field.message_type() != nullptr) return {field.name(), bounded, 0, ranges_per_message_max};
  return {field.name(), related};
}

template <typename... Messages>
void add_related(std::map<const Descriptor*, TypeRules>& all) {
  ((all[Messages::descriptor()].require_related =
        [](const Base& message) { require_related(static_cast<const Messages&>(message)); }),
   ...);
}

std::map<const Descriptor*, TypeRules> make_rules() {
  std::map<const Descriptor*, TypeRules> all;
  for (const auto* const file :
       {proto::Envelope::descriptor()->file(), proto::RequestEnvelope::descriptor()->file()}) {
    for (int i = 0; i < file->message_type_count(); ++i) {
      const Descriptor& type = *file->message_type(i);
      std::vector<FieldRule>& fields = all[&type].fields;
      for (int j = 0; j < type.field_count(); ++j) {
        const Field& field = *type.field(j);
        Rule rule = rule_for(field);
        if (rule.kind == related) continue;
        if (rule.called.empty()) rule.called = field.name();
        const Descriptor* const inner = field.message_type();
        fields.push_back({&field, rule, inner == nullptr ? nullptr : &all[inner]});
      }
    }
  }
  add_related<proto::Range, proto::Hello, proto::Welcome, proto::DefinitionPart, proto::RunLease,
              proto::GiveBack, proto::Heartbeat, proto::ComputedRun, proto::ResultAck,
              proto::DataTable, proto::RequestPart, proto::AnswerRequest, proto::AnswerReply,
              proto::CampaignStatus>(all);
  return all;
}

const TypeRules& rules_of(const Base& message) {
  static const auto all = make_rules();
  return all.at(message.GetDescriptor());
}

// Checking.

void require_name(const std::string& name, std::string_view field) {
  // The name itself is not repeated: it may hold anything.
  require(is_name(name), field, fmt::format("{} bytes", name.size()), is_name_rule);
}

bool may_be_in_text(char c) { return c == '\n' || (c >= ' ' && c <= '~'); }

void check(const Base& message, const TypeRules& rules);

void check_text(const std::string& value, const Rule& rule) {
  const auto& [name, kind, least, most, called] = rule;
  if (kind == identifier || (kind == name_or_none && !value.empty())) {
    return require_name(value, called);
  }
  if (kind == bounded) return require_in(value.size(), least, most, fmt::format("{} size", called));
  if (kind == cards) {
    require_in(value.size(), 0, most, "size of cards");
    return require(printable(value) == value, called, printable(value), "must be printable ASCII");
  }
  require(value.size() <= most || kind == name_or_none, called,
          fmt::format("{} bytes", value.size()), fmt::format("must be at most {}", most));
  require(kind != text || std::ranges::all_of(value, may_be_in_text), called,
          fmt::format("{} bytes", value.size()), "must be printable ASCII and line ends");
}

void check_number(std::uint64_t value, const Rule& rule) {
  const auto& [name, kind, least, most, called] = rule;
  if (kind == bounded) return require_in(value, least, most, called);
  if (kind == identifier) return require(value != 0, called, "0", "must not be 0");
  require(value < 64 && (most >> value) % 2 == 1, called, fmt::format("{}", value),
          "must be one that this message may give");
}

void check_value(const Base& message, const FieldRule& of) {
  const auto& values = *message.GetReflection();
  std::string scratch;
  switch (of.field->cpp_type()) {
    case Field::CPPTYPE_MESSAGE:
      return check(values.GetMessage(message, of.field), *of.content);
    case Field::CPPTYPE_STRING:
      return check_text(values.GetStringReference(message, of.field, &scratch), of.rule);
    case Field::CPPTYPE_DOUBLE: {
      const double value = values.GetDouble(message, of.field);
      return of.rule.kind == fraction ? require_in(value, 0.0, 1.0, of.rule.called)
                                      : require_magnitude(value, of.rule.called);
    }
    case Field::CPPTYPE_INT32: {
      const auto most = static_cast<std::int32_t>(of.rule.most);
      return require_in(values.GetInt32(message, of.field), -most, most, of.rule.called);
    }
    case Field::CPPTYPE_UINT32:
      return check_number(values.GetUInt32(message, of.field), of.rule);
    case Field::CPPTYPE_UINT64:
      return check_number(values.GetUInt64(message, of.field), of.rule);
    case Field::CPPTYPE_ENUM:
      return check_number(static_cast<std::uint32_t>(values.GetEnumValue(message, of.field)),
                          of.rule);
    default:
      PROOFMASS_EXPECT(false);
  }
}

void check_list(const Base& message, const FieldRule& of) {
  const auto& values = *message.GetReflection();
  if (of.rule.kind == finite) {
    const auto numbers = values.GetRepeatedFieldRef<double>(message, of.field);
    const auto bad = std::find_if_not(numbers.begin(), numbers.end(),
                                      [](double value) { return std::isfinite(value); });
    if (bad == numbers.end()) return;
    throw ConfigError(of.rule.called, fmt::format("{}", *bad), "must be finite");
  }
  const int count = values.FieldSize(message, of.field);
  require_in(static_cast<std::uint64_t>(count), of.rule.least, of.rule.most, of.rule.called,
             " entries");
  for (int i = 0; i < count; ++i) {
    if (of.content != nullptr) check(values.GetRepeatedMessage(message, of.field, i), *of.content);
    if (of.rule.kind != identifier) continue;
    require_name(values.GetRepeatedString(message, of.field, i), of.rule.called);
  }
}

/// A message that is absent is checked as an empty one, unless it is `optional`.
void check(const Base& message, const TypeRules& rules) {
  for (const FieldRule& of : rules.fields) {
    const Field& field = *of.field;
    if (field.is_repeated()) {
      check_list(message, of);
    } else if ((field.real_containing_oneof() == nullptr && !field.has_optional_keyword()) ||
               message.GetReflection()->HasField(message, &field)) {
      check_value(message, of);
    }
  }
  if (rules.require_related != nullptr) rules.require_related(message);
}

// Sending.

std::string sendable(const std::string& value, const Rule& rule) {
  if (rule.kind == identifier || (rule.kind == name_or_none && !value.empty())) {
    return name_from(value);
  }
  std::string result = value.substr(0, reply_text_size_max);
  std::ranges::replace_if(
      result, [](char c) { return !may_be_in_text(c); }, '?');
  return result;
}

}  // namespace

void check_rules(const Base& message) { check(message, rules_of(message)); }

void make_sendable(Base& message) {
  const auto& values = *message.GetReflection();
  for (const auto& [field, rule, content] : rules_of(message).fields) {
    const bool is_list = field->is_repeated();
    const int count = is_list ? values.FieldSize(message, field) : 0;
    if (field->type() == Field::TYPE_STRING && !is_list) {
      values.SetString(&message, field, sendable(values.GetString(message, field), rule));
    } else if (field->type() == Field::TYPE_STRING) {
      for (int i = 0; i < count; ++i) {
        values.SetRepeatedString(&message, field, i,
                                 sendable(values.GetRepeatedString(message, field, i), rule));
      }
    } else if (content != nullptr && is_list) {
      for (int i = 0; i < count; ++i) {
        make_sendable(*values.MutableRepeatedMessage(&message, field, i));
      }
    } else if (!is_list && values.HasField(message, field)) {
      if (content != nullptr) make_sendable(*values.MutableMessage(&message, field));
      if (rule.kind != magnitude) continue;
      const double value = values.GetDouble(message, field);
      values.SetDouble(&message, field, std::isfinite(value) && value > 0.0 ? value : 0.0);
    }
  }
}

}  // namespace proofmass::wire::detail
