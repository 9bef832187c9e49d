#include "proto/wire/definition_message.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"

namespace proofmass::wire::detail {
namespace {

constexpr std::uint64_t tables_max = 64;
constexpr std::uint64_t columns_of_a_table_max = 64;
constexpr std::uint64_t table_columns_max = 1024;

using Values = google::protobuf::RepeatedField<double>;

std::vector<double> finite_values(const Values& values, std::string_view field) {
  const auto bad = std::find_if_not(values.begin(), values.end(),
                                    [](double value) { return std::isfinite(value); });
  require(bad == values.end(), field, bad == values.end() ? "" : fmt::format("{}", *bad),
          "must be finite");
  return {values.begin(), values.end()};
}

DataTable read_table(const proto::DataTable& message) {
  require_in(message.num_columns(), 1, columns_of_a_table_max, "definition.tables.num_columns");
  const auto size = static_cast<std::uint64_t>(message.values_size());
  require(size % message.num_columns() == 0, "definition.tables.values",
          fmt::format("{} entries", size),
          fmt::format("must be rows of {}", message.num_columns()));
  return {.key = checked_name(message.key(), "definition.tables.key"),
          .num_columns = message.num_columns(),
          .values = finite_values(message.values(), "definition.tables.values")};
}

}  // namespace

void write_definition(const Definition& definition, proto::Definition& message) {
  message.set_text(definition.text);
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
  require_in(message.text().size(), 1, definition_text_size_max, "definition.text size");
  require_count(message.tables_size(), 0, tables_max, "definition.tables");
  require_count(message.table_columns_size(), 0, table_columns_max, "definition.table_columns");
  Definition definition{.text = message.text()};
  for (const proto::DataTable& table : message.tables()) {
    definition.tables.push_back(read_table(table));
  }
  for (const proto::TableColumn& column : message.table_columns()) {
    definition.table_columns.push_back(
        finite_values(column.values(), "definition.table_columns.values"));
  }
  return definition;
}

}  // namespace proofmass::wire::detail
