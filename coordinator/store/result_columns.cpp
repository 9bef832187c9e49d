#include "coordinator/store/result_columns.hpp"

#include <fmt/format.h>

#include <array>
#include <span>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

void append(std::vector<ValueColumn>& columns, ValueKind kind, std::size_t index,
            const auto& quantity) {
  columns.push_back({.kind = kind,
                     .index = index,
                     .own_name = quantity.column(),
                     .name = fmt::format("{}_{}", name_of(kind), quantity.column()),
                     .unit = quantity.unit});
}

}  // namespace

std::vector<ValueColumn> value_columns(const ResultSchema& schema) {
  std::vector<ValueColumn> columns;
  for (const ValueKind kind : {ValueKind::truth, ValueKind::estimate, ValueKind::error}) {
    for (std::size_t i = 0; i < schema.quantities.size(); ++i) {
      append(columns, kind, i, schema.quantities[i]);
    }
  }
  std::size_t num_standard_errors = 0;
  for (const Quantity& quantity : schema.quantities) {
    if (!quantity.has_standard_error) continue;
    append(columns, ValueKind::standard_error, num_standard_errors++, quantity);
  }
  for (std::size_t i = 0; i < schema.fit.size(); ++i) {
    append(columns, ValueKind::fit, i, schema.fit[i]);
  }
  for (std::size_t i = 0; i < schema.health.size(); ++i) {
    append(columns, ValueKind::health, i, schema.health[i]);
  }
  return columns;
}

namespace {

/// The list that has the value; empty if the run's status leaves it without a meaning.
std::span<const double> values_in(const RunResult& result, ValueKind kind) {
  switch (kind) {
    case ValueKind::truth:
      if (!result.has_truth()) return {};
      return result.truth;
    case ValueKind::estimate:
    case ValueKind::error:
      if (!result.has_estimate()) return {};
      return result.estimate;
    case ValueKind::standard_error:
      return result.standard_error;
    case ValueKind::fit:
      return result.fit;
    case ValueKind::health:
      return result.health;
  }
  PROOFMASS_EXPECT(false);
  return {};
}

}  // namespace

std::string_view name_of(ValueKind kind) {
  constexpr std::array<std::string_view, 6> names{"truth",          "estimate", "error",
                                                  "standard_error", "fit",      "health"};
  return names.at(static_cast<std::size_t>(kind));
}

std::optional<double> ValueColumn::value_in(const RunResult& result) const {
  const std::span<const double> values = values_in(result, kind);
  if (index >= values.size()) return std::nullopt;
  return kind == ValueKind::error ? result.error(index) : values[index];
}

}  // namespace proofmass::coordinator
