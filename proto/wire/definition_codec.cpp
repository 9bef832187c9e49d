#include "proto/wire/definition_codec.hpp"

#include <fmt/format.h>

#include <utility>

#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"

namespace proofmass::wire {
namespace {

/// Tables and columns have at most some thousands of fields.
constexpr detail::Form definition_form{.name = "definition",
                                       .kind = "a definition",
                                       .size_max = definition_size_max,
                                       .fields_max = 4096};

using Values = google::protobuf::RepeatedField<double>;

std::vector<double> vector_of(const Values& values) { return {values.begin(), values.end()}; }
}  // namespace

namespace detail {

void write_definition(const Definition& definition, proto::Definition& message) {
  message.set_text(definition.text);
  message.set_model_version(definition.model);
  for (const DataTable& table : definition.tables) {
    proto::DataTable& sent = *message.add_tables();
    sent.set_key(table.key);
    sent.set_num_columns(table.num_columns);
    sent.mutable_values()->Assign(table.values.begin(), table.values.end());
  }
  for (const std::vector<double>& column : definition.table_columns) {
    message.add_table_columns()->mutable_values()->Assign(column.begin(), column.end());
  }
}

Definition read_definition(const proto::Definition& message) {
  Definition definition{.text = message.text(), .model = message.model_version()};
  for (const proto::DataTable& table : message.tables()) {
    definition.tables.push_back({.key = table.key(),
                                 .num_columns = table.num_columns(),
                                 .values = vector_of(table.values())});
  }
  for (const proto::TableColumn& column : message.table_columns()) {
    definition.table_columns.push_back(vector_of(column.values()));
  }
  return definition;
}

}  // namespace detail

std::string encode_definition(const Definition& definition) {
  proto::Definition message;
  detail::write_definition(definition, message);
  return detail::bytes_of(message, definition_form);
}

Definition decode_definition(std::string_view bytes) {
  proto::Definition message;
  auto fault = detail::parse(bytes, definition_form, message);
  if (!fault) fault = detail::fault_in(message);
  if (fault) throw Error(fault->text);
  return detail::read_definition(message);
}

EncodedDefinition::EncodedDefinition(std::string bytes)
    : bytes_(std::move(bytes)), checksum_(fnv1a(bytes_)) {}

proto::DefinitionPart EncodedDefinition::part(CampaignId campaign, std::uint64_t offset) const {
  if (offset >= bytes_.size()) offset = 0;
  proto::DefinitionPart part;
  part.set_campaign(campaign.value);
  part.set_offset(offset);
  part.set_total_size(bytes_.size());
  part.set_checksum(checksum_);
  part.set_content(bytes_.substr(offset, definition_part_size_max));
  return part;
}

IncomingDefinition::Progress IncomingDefinition::add(const proto::DefinitionPart& part) {
  if (part.total_size() != total_size_ || part.checksum() != checksum_) {
    total_size_ = part.total_size();
    checksum_ = part.checksum();
    bytes_.clear();
    if (part.offset() > 0) return Progress::advanced;
  }
  if (part.offset() != bytes_.size()) return Progress::ignored;
  bytes_ += part.content();
  return bytes_.size() == total_size_ ? Progress::complete : Progress::advanced;
}

Definition IncomingDefinition::take() {
  PROOFMASS_EXPECT(bytes_.size() == total_size_);
  const std::string bytes = std::exchange(bytes_, {});
  total_size_ = 0;
  const std::uint64_t expected = std::exchange(checksum_, 0);
  const std::uint64_t found = fnv1a(bytes);
  if (found != expected) {
    throw Error(
        fmt::format("checksum = {:016x} (must be {:016x}, the definition's)", found, expected));
  }
  return decode_definition(bytes);
}

}  // namespace proofmass::wire
