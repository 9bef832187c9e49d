#include "coordinator/archive/result_columns.hpp"

#include <cstddef>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

std::array<ValueColumn, num_value_columns> make_columns() {
  std::array<ValueColumn, num_value_columns> columns;
  std::size_t i = 0;
  for (const ValueKind kind : {ValueKind::truth, ValueKind::estimate, ValueKind::error}) {
    for (const ParameterInfo& info : parameter_infos()) {
      ValueColumn& column = columns[i++];
      column.kind = kind;
      column.parameter = info.parameter;
      column.parameter_name = std::string(info.name) + std::string(info.unit_suffix);
      column.name = std::string(name_of(kind)) + "_" + column.parameter_name;
      column.unit = info.unit;
    }
  }
  return columns;
}

}  // namespace

std::string_view name_of(ValueKind kind) {
  switch (kind) {
    case ValueKind::truth:
      return "truth";
    case ValueKind::estimate:
      return "estimate";
    case ValueKind::error:
      return "error";
  }
  PROOFMASS_EXPECT(false);
  return {};
}

std::optional<double> ValueColumn::value_in(const RunResult& result) const {
  const bool is_known = kind == ValueKind::truth ? result.has_truth() : result.has_estimate();
  if (!is_known) return std::nullopt;
  switch (kind) {
    case ValueKind::truth:
      return result.truth[index(parameter)];
    case ValueKind::estimate:
      return result.estimate[index(parameter)];
    case ValueKind::error:
      return result.error(parameter);
  }
  PROOFMASS_EXPECT(false);
  return {};
}

const std::array<ValueColumn, num_value_columns>& value_columns() {
  static const std::array<ValueColumn, num_value_columns> columns = make_columns();
  return columns;
}

}  // namespace proofmass::coordinator
