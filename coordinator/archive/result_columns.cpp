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
      column.own_name = std::string(info.name) + std::string(info.unit_suffix);
      column.name = std::string(name_of(kind)) + "_" + column.own_name;
      column.unit = info.unit;
    }
  }
  for (const HealthValue& value : health_values()) {
    ValueColumn& column = columns[i++];
    column.kind = ValueKind::health;
    column.health = value.member;
    column.own_name = std::string(value.name) + std::string(value.unit_suffix);
    column.name = "health_" + column.own_name;
    column.unit = value.unit;
  }
  return columns;
}

bool is_known(ValueKind kind, const RunResult& result) {
  switch (kind) {
    case ValueKind::truth:
      return result.has_truth();
    case ValueKind::estimate:
    case ValueKind::error:
      return result.has_estimate();
    case ValueKind::health:
      return result.health.has_value();
  }
  PROOFMASS_EXPECT(false);
  return false;
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
    case ValueKind::health:
      return "health";
  }
  PROOFMASS_EXPECT(false);
  return {};
}

std::optional<double> ValueColumn::value_in(const RunResult& result) const {
  if (!is_known(kind, result)) return std::nullopt;
  switch (kind) {
    case ValueKind::truth:
      return result.truth[index(parameter)];
    case ValueKind::estimate:
      return result.estimate[index(parameter)];
    case ValueKind::error:
      return result.error(parameter);
    case ValueKind::health:
      return (*result.health).*health;
  }
  PROOFMASS_EXPECT(false);
  return {};
}

const std::array<ValueColumn, num_value_columns>& value_columns() {
  static const std::array<ValueColumn, num_value_columns> columns = make_columns();
  return columns;
}

}  // namespace proofmass::coordinator
