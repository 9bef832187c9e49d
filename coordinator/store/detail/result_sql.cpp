#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <vector>

#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::string_view next_column = ",\n  ";

/// What `text_of` yields for each item, with the separator between them.
template <typename Items, typename TextOf>
std::string joined(const Items& items, std::string_view separator, const TextOf& text_of) {
  std::string text;
  for (const auto& item : items) {
    if (!text.empty()) text += separator;
    text += text_of(item);
  }
  return text;
}

/// Columns of run_result with the standard errors and their fit, if the campaign has them.
std::vector<std::string> columns_of_standard_errors(const ResultSchema& schema) {
  std::vector<std::string> names;
  for (const ValueColumn& column : value_columns(schema)) {
    if (is_of_standard_errors(column)) names.push_back(column.name);
  }
  return names;
}

/// Columns that are NULL where `is_absent` holds.
std::string nullable_columns(const ResultSchema& schema, std::string_view prefix,
                             std::string_view is_absent) {
  return joined(schema.quantities, next_column, [&](const Quantity& quantity) {
    const std::string name = fmt::format("{}_{}", prefix, quantity.column());
    return fmt::format("{0} REAL CHECK (({0} IS NULL) = ({1}))", name, is_absent);
  });
}

std::string error_columns(const ResultSchema& schema) {
  return joined(schema.quantities, next_column, [](const Quantity& quantity) {
    return fmt::format("error_{0} REAL AS (estimate_{0} - truth_{0})", quantity.column());
  });
}

/// The columns that the schema has from version 10.
std::string added_columns(const ResultSchema& schema) {
  std::string text = joined(columns_of_standard_errors(schema), "", [](const std::string& column) {
    return fmt::format("ALTER TABLE run_result ADD COLUMN {} REAL;\n", column);
  });
  if (text.empty()) return text;
  if (num_correlations(schema) > 0) {
    text += "ALTER TABLE run_result ADD COLUMN correlations TEXT;\n";
  }
  return text + fmt::format(
                    "CREATE INDEX run_result_standard_errors ON run_result (run_index)\n"
                    "WHERE {};\n",
                    has_standard_errors_sql(schema));
}

/// NULL where no quantity has one.
std::string standard_error_of_parameter(const ResultSchema& schema) {
  int position = 0;
  const std::string text = joined(schema.quantities, "", [&](const Quantity& quantity) {
    ++position;
    return quantity.has_standard_error ? fmt::format("\n         WHEN {} THEN r.standard_error_{}",
                                                     position, quantity.column())
                                       : std::string();
  });
  return text.empty() ? "NULL" : "CASE p.position" + text + " END";
}

std::string data_tables(const Model& model) {
  return joined(model.tables(), "", [](const DataTableSchema& table) {
    const std::string columns = joined(table.columns, "", [](std::string_view column) {
      return fmt::format(",\n  {} REAL NOT NULL", column);
    });
    return fmt::format("-- {}\nCREATE TABLE {} (\n  position INTEGER PRIMARY KEY{}\n) STRICT;\n",
                       table.comment, table.table, columns);
  });
}

std::string digested_tables(const Model& model) {
  const std::string text = joined(model.tables(), ", ", std::mem_fn(&DataTableSchema::table));
  return text.empty() ? "dispersion_value" : text + " and dispersion_value";
}

/// The format for the column of each quantity of health or fit, one after the other.
std::string columns_as(fmt::format_string<std::string> format,
                       const std::vector<HealthQuantity>& quantities) {
  return joined(quantities, "", [&](const HealthQuantity& quantity) {
    return fmt::format(format, quantity.column());
  });
}

std::string value_of_parameter(const ResultSchema& schema, std::string_view prefix) {
  int position = 0;
  const std::string text = joined(schema.quantities, "", [&](const Quantity& quantity) {
    return fmt::format("\n         WHEN {} THEN r.{}_{}", ++position, prefix, quantity.column());
  });
  return "CASE p.position" + text + " END";
}

std::string budget_total(const ResultSchema& schema) {
  return joined(schema.quantities, "\n       + ", [](const Quantity& quantity) {
    return fmt::format(
        "abs(error_{}) * (SELECT ifnull(sum(value), 0.0) FROM budget_coefficient"
        " WHERE parameter = '{}')",
        quantity.column(), quantity.name);
  });
}

/// Of the row r of run_result; what the schema has from version 9.
std::string budget_total_at_level(const ResultSchema& schema) {
  if (schema.budget_terms.empty()) return "NULL";
  const std::string level = schema.health.at(schema.budget_level).column();
  return joined(schema.quantities, "\n       + ", [&](const Quantity& quantity) {
    return fmt::format(
        "abs(r.error_{0}) * (SELECT ifnull(sum(value), 0.0) FROM budget_coefficient"
        " WHERE parameter = '{1}' AND assumed_level IS NULL)\n"
        "       + abs(r.error_{0}) * coalesce(nullif(r.health_{2}, 0.0), (SELECT "
        "max(assumed_level) FROM"
        " budget_coefficient))\n         * (SELECT ifnull(sum(value / assumed_level), 0.0) FROM"
        " budget_coefficient WHERE parameter = '{1}')",
        quantity.column(), quantity.name, level);
  });
}

/// The names of choices that are stored as 1, 2, ...
std::string name_of_choice(std::string_view column, const std::vector<std::string_view>& names) {
  if (names.empty()) return "NULL";
  std::size_t number = 0;
  const std::string text = joined(names, "", [&](std::string_view name) {
    return fmt::format("\n         WHEN {} THEN '{}'", ++number, name);
  });
  return fmt::format("CASE r.{}{} END", column, text);
}

std::vector<std::string_view> status_names() {
  std::vector<std::string_view> names;
  for (int value = 1; value <= static_cast<int>(RunStatus::lost); ++value) {
    names.push_back(name_of(static_cast<RunStatus>(value)));
  }
  return names;
}

std::map<std::string_view, std::string> texts(const Model& model, const ResultSchema& schema) {
  return {
      {"data_tables", data_tables(model)},
      {"digested_tables", digested_tables(model)},
      {"example_quantity", example_quantity(schema).name},
      {"truth_columns", nullable_columns(schema, "truth", "status = 4")},
      {"estimate_columns", nullable_columns(schema, "estimate", "status > 2")},
      {"error_columns", error_columns(schema)},
      {"standard_error_columns", ""},  // In version 8 no model had any.
      {"added_columns", added_columns(schema)},
      {"standard_error_of_parameter", standard_error_of_parameter(schema)},
      {"fit_values", columns_as(", r.fit_{0} AS {0}", schema.fit)},
      {"health_columns", columns_as("health_{0} REAL,\n  ", schema.health)},
      {"health_values", columns_as("r.health_{0} AS {0},\n       ", schema.health)},
      {"status_name", name_of_choice("status", status_names())},
      {"loss_cause_name", name_of_choice("loss_cause", schema.loss_causes)},
      {"loss_session_name", name_of_choice("loss_session", schema.loss_sessions)},
      {"truth_of_parameter", value_of_parameter(schema, "truth")},
      {"estimate_of_parameter", value_of_parameter(schema, "estimate")},
      {"error_of_parameter", value_of_parameter(schema, "error")},
      {"budget_total", budget_total(schema)},
      {"budget_total_at_level", budget_total_at_level(schema)},
      {"num_causes", std::to_string(schema.loss_causes.size())},
      {"cause_names", fmt::format("{}", fmt::join(schema.loss_causes, ", "))},
      {"num_sessions", std::to_string(schema.loss_sessions.size())},
      {"session_names", fmt::format("{}", fmt::join(schema.loss_sessions, ", "))},
  };
}

}  // namespace

std::string has_standard_errors_sql(const ResultSchema& schema) {
  std::vector<std::string> columns = columns_of_standard_errors(schema);
  if (num_correlations(schema) > 0) columns.emplace_back("correlations");
  return joined(columns, "\n   OR ", [](const auto& column) { return column + " IS NOT NULL"; });
}

std::string with_quantities(std::string_view sql, const Model& model, const ResultSchema& schema) {
  const std::map<std::string_view, std::string> replacements = texts(model, schema);
  std::string text;
  while (true) {
    const std::size_t begin = std::min(sql.find('{'), sql.size());
    text += sql.substr(0, begin);
    if (begin == sql.size()) return text;
    const std::size_t end = sql.find('}', begin);
    PROOFMASS_EXPECT(end != std::string_view::npos);
    text += replacements.at(sql.substr(begin + 1, end - begin - 1));
    sql.remove_prefix(end + 1);
  }
}

}  // namespace proofmass::coordinator::detail
