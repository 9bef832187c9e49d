#include "proto/wire/rules.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/reflection.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <map>
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
using google::protobuf::Reflection;

enum class Kind : std::uint8_t {
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
using enum Kind;

struct Rule {
  std::string_view field;  ///< Of any message, or of one: `Hello.num_slots`.
  Kind kind = bounded;
  std::uint64_t least = 0;
  std::uint64_t most = 0;
  std::string_view called = {};  ///< In texts; by its own name if empty.
};

constexpr std::uint64_t bits_of(std::initializer_list<LossReason> reasons) {
  std::uint64_t bits = 0;
  for (const LossReason reason : reasons) bits |= std::uint64_t{1} << static_cast<unsigned>(reason);
  return bits;
}

/// Others: a text is a name, an enumerator not 0, a number with a fraction finite and not negative.
/// A list of messages has at most ranges_per_message_max, and integers may be any.
constexpr auto rules = std::to_array<Rule>({
    // Between workers and coordinator.
    {"attempt", identifier},
    {"campaign", identifier},
    {"cards", cards, 0, cards_text_size_max},
    {"other_models", bounded, 0, other_models_max},
    {"ranges", bounded, 1, ranges_per_message_max},
    {"results", bounded, 1, runs_per_lease_max},
    {"session", identifier},
    {"worker_id", identifier},
    {"Bye.reason", one_of, 0,
     bits_of(
         {LossReason::drained, LossReason::walltime, LossReason::preempted, LossReason::failed})},
    {"CampaignRequest.offset", bounded, 0, definition_size_max - 1},
    {"ComputedRun.run", bounded, 0, num_runs_max - 1},
    {"DefinitionPart.content", related},
    {"DefinitionPart.total_size", bounded, 1, definition_size_max},
    {"Forget.num_runs", bounded, 1, num_runs_max},
    {"FormerSession.reason", one_of, 0,
     bits_of({LossReason::crashed, LossReason::out_of_memory, LossReason::preempted})},
    {"FormerSession.session", identifier, 0, 0, "former session"},
    {"FormerSession.signal", bounded, 0, signal_max, "former signal"},
    {"GiveBack.reason", one_of, 0,
     bits_of({LossReason::crashed, LossReason::retracted, LossReason::drained, LossReason::walltime,
              LossReason::preempted, LossReason::failed})},
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
    // Definitions.
    {"DataTable.key", identifier, 0, 0, "definition.tables.key"},
    {"DataTable.num_columns", bounded, 1, columns_of_a_table_max, "definition.tables.num_columns"},
    {"DataTable.values", finite, 0, 0, "definition.tables.values"},
    {"Definition.model_version", name_or_none, 0, 0, "definition.model_version"},
    {"Definition.table_columns", bounded, 0, table_columns_max, "definition.table_columns"},
    {"Definition.tables", bounded, 0, definition_tables_max, "definition.tables"},
    {"Definition.text", bounded, 1, definition_text_size_max, "definition.text"},
    {"TableColumn.values", finite, 0, 0, "definition.table_columns.values"},
    // Between clients and coordinator.
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

// The rules of each type of message, found once.

struct TypeRules;

struct FieldRule {
  const Field* field;
  Rule rule;
  std::string called;
  const TypeRules* content;  ///< Of the messages that it holds.
};

struct TypeRules {
  std::vector<FieldRule> fields;  ///< That have a rule, in the order of their declaration.
  void (*require_related)(const Base&) = nullptr;  ///< Null if there is nothing more.
};

using AllRules = std::map<const Descriptor*, TypeRules>;

Rule rule_for(const Field& field) {
  const std::string in_message = field.containing_type()->name() + "." + field.name();
  for (const std::string& name : {in_message, field.name()}) {
    const auto* const found = std::ranges::find(rules, name, &Rule::field);
    if (found != rules.end()) return *found;
  }
  const auto* const enumerators = field.enum_type();
  if (enumerators != nullptr) {
    const int last = enumerators->value(enumerators->value_count() - 1)->number();
    return {field.name(), bounded, 1, static_cast<std::uint64_t>(last)};
  }
  if (field.cpp_type() == Field::CPPTYPE_DOUBLE && !field.is_repeated()) {
    return {field.name(), magnitude};
  }
  if (field.cpp_type() == Field::CPPTYPE_STRING) return {field.name(), identifier};
  if (field.message_type() != nullptr) return {field.name(), bounded, 0, ranges_per_message_max};
  return {field.name(), related};
}

AllRules make_rules() {
  AllRules all;
  for (const auto* const file :
       {proto::Envelope::descriptor()->file(), proto::RequestEnvelope::descriptor()->file()}) {
    for (int i = 0; i < file->message_type_count(); ++i) {
      const Descriptor& type = *file->message_type(i);
      std::vector<FieldRule>& fields = all[&type].fields;
      all[&type].require_related = related_rules_of(type);
      for (int j = 0; j < type.field_count(); ++j) {
        const Field& field = *type.field(j);
        const Rule rule = rule_for(field);
        const Descriptor* const inner = field.message_type();
        if (rule.kind == related) continue;
        std::string called(rule.called.empty() ? field.name() : rule.called);
        const bool is_text = field.cpp_type() == Field::CPPTYPE_STRING && !field.is_repeated();
        if (is_text && rule.kind == bounded) called += " size";
        fields.push_back({&field, rule, called, inner == nullptr ? nullptr : &all[inner]});
      }
    }
  }
  return all;
}

const TypeRules& rules_of(const Base& message) {
  static const AllRules all = make_rules();
  return all.at(message.GetDescriptor());
}

// Checking.

void require_name(const std::string& name, std::string_view field) {
  // The name itself is not repeated: it may hold anything.
  require(is_name(name), field, fmt::format("{} bytes", name.size()), is_name_rule);
}

bool may_be_in_text(char c) { return c == '\n' || (c >= ' ' && c <= '~'); }

void check(const Base& message, const TypeRules& rules);

void check_text(const std::string& value, const FieldRule& of) {
  const auto& [name, kind, least, most, called] = of.rule;
  if (kind == identifier || (kind == name_or_none && !value.empty())) {
    return require_name(value, of.called);
  }
  if (kind == bounded) return require_in(value.size(), least, most, of.called);
  if (kind == cards) {
    require_in(value.size(), 0, most, "size of cards");
    return require(printable(value) == value, of.called, printable(value),
                   "must be printable ASCII");
  }
  require(value.size() <= most || kind == name_or_none, of.called,
          fmt::format("{} bytes", value.size()), fmt::format("must be at most {}", most));
  require(kind != text || std::ranges::all_of(value, may_be_in_text), of.called,
          fmt::format("{} bytes", value.size()), "must be printable ASCII and line ends");
}

void check_number(std::uint64_t value, const FieldRule& of) {
  const auto& [name, kind, least, most, called] = of.rule;
  if (kind == bounded) return require_in(value, least, most, of.called);
  if (kind == identifier) return require(value != 0, of.called, "0", "must not be 0");
  require(value < 64 && (most >> value) % 2 == 1, of.called, fmt::format("{}", value),
          "must be one that this message may give");
}

void check_value(const Base& message, const FieldRule& of) {
  const Reflection& values = *message.GetReflection();
  std::string scratch;
  switch (of.field->cpp_type()) {
    case Field::CPPTYPE_MESSAGE:
      return check(values.GetMessage(message, of.field), *of.content);
    case Field::CPPTYPE_STRING:
      return check_text(values.GetStringReference(message, of.field, &scratch), of);
    case Field::CPPTYPE_DOUBLE: {
      const double value = values.GetDouble(message, of.field);
      return of.rule.kind == fraction ? require_in(value, 0.0, 1.0, of.called)
                                      : require_magnitude(value, of.called);
    }
    case Field::CPPTYPE_INT32: {
      const auto most = static_cast<std::int32_t>(of.rule.most);
      return require_in(values.GetInt32(message, of.field), -most, most, of.called);
    }
    case Field::CPPTYPE_UINT32:
      return check_number(values.GetUInt32(message, of.field), of);
    case Field::CPPTYPE_UINT64:
      return check_number(values.GetUInt64(message, of.field), of);
    case Field::CPPTYPE_ENUM:
      return check_number(static_cast<std::uint32_t>(values.GetEnumValue(message, of.field)), of);
    default:
      PROOFMASS_EXPECT(false);
  }
}

void check_list(const Base& message, const FieldRule& of) {
  const Reflection& values = *message.GetReflection();
  if (of.rule.kind == finite) {
    const auto numbers = values.GetRepeatedFieldRef<double>(message, of.field);
    const auto bad = std::find_if_not(numbers.begin(), numbers.end(),
                                      [](double value) { return std::isfinite(value); });
    if (bad == numbers.end()) return;
    throw ConfigError(of.called, fmt::format("{}", *bad), "must be finite");
  }
  const int count = values.FieldSize(message, of.field);
  require_in(static_cast<std::uint64_t>(count), of.rule.least, of.rule.most, of.called, " entries");
  for (int i = 0; i < count && of.content != nullptr; ++i) {
    check(values.GetRepeatedMessage(message, of.field, i), *of.content);
  }
  for (int i = 0; i < count && of.rule.kind == identifier; ++i) {
    require_name(values.GetRepeatedString(message, of.field, i), of.called);
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

void make_field_sendable(Base& message, const FieldRule& of) {
  const Reflection& values = *message.GetReflection();
  const Field* const field = of.field;
  const int count = field->is_repeated() ? values.FieldSize(message, field) : 0;
  if (field->type() == Field::TYPE_STRING) {
    if (!field->is_repeated()) {
      values.SetString(&message, field, sendable(values.GetString(message, field), of.rule));
    }
    for (int i = 0; i < count; ++i) {
      values.SetRepeatedString(&message, field, i,
                               sendable(values.GetRepeatedString(message, field, i), of.rule));
    }
  } else if (of.content != nullptr) {
    if (!field->is_repeated() && values.HasField(message, field)) {
      make_sendable(*values.MutableMessage(&message, field));
    }
    for (int i = 0; i < count; ++i) {
      make_sendable(*values.MutableRepeatedMessage(&message, field, i));
    }
  } else if (of.rule.kind == magnitude && values.HasField(message, field)) {
    const double value = values.GetDouble(message, field);
    values.SetDouble(&message, field, std::isfinite(value) && value > 0.0 ? value : 0.0);
  }
}

}  // namespace

void check_rules(const Base& message) { check(message, rules_of(message)); }

void make_sendable(Base& message) {
  for (const FieldRule& of : rules_of(message).fields) make_field_sendable(message, of);
}

}  // namespace proofmass::wire::detail
