#include "core/campaign/result_columns.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace proofmass {
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

std::vector<std::string> result_column_names(const ResultSchema& schema) {
  std::vector<std::string> names{"run_index",  "status",       "num_draws",   "num_rounds",
                                 "loss_cause", "loss_session", "correlations"};
  for (ValueColumn& column : value_columns(schema)) names.push_back(std::move(column.name));
  return names;
}

std::string_view name_of(ValueKind kind) {
  constexpr std::array<std::string_view, 6> names{"truth",          "estimate", "error",
                                                  "standard_error", "fit",      "health"};
  return names.at(static_cast<std::size_t>(kind));
}

std::optional<double> ValueColumn::value_in(const RunResult& result) const {
  const bool is_of_estimate = kind == ValueKind::estimate || kind == ValueKind::error;
  if (kind == ValueKind::truth && !result.has_truth()) return std::nullopt;
  if (is_of_estimate && !result.has_estimate()) return std::nullopt;
  const std::array lists{&result.truth,          &result.estimate, &result.estimate,
                         &result.standard_error, &result.fit,      &result.health};
  const std::vector<double>& values = *lists.at(static_cast<std::size_t>(kind));
  if (index >= values.size()) return std::nullopt;
  return kind == ValueKind::error ? result.error(index) : values[index];
}

}  // namespace proofmass
