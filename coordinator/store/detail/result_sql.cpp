#include "coordinator/store/detail/result_sql.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "core/campaign/loop_health.hpp"
#include "core/campaign/parameter.hpp"
#include "core/campaign/run_result.hpp"
#include "core/error.hpp"
#include "core/session/session_names.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr std::string_view next_column = ",\n  ";

std::string column_name(const ParameterInfo& info) {
  return fmt::format("{}{}", info.name, info.unit_suffix);
}

/// What `text_of` yields for each parameter, one a line.
template <typename TextOf>
std::string for_each_parameter(std::string_view separator, const TextOf& text_of) {
  std::string text;
  for (const ParameterInfo& info : parameter_infos()) {
    if (!text.empty()) text += separator;
    text += text_of(info);
  }
  return text;
}

/// Columns that are NULL where `is_absent` holds.
std::string value_columns(std::string_view prefix, std::string_view is_absent) {
  return for_each_parameter(next_column, [&](const ParameterInfo& info) {
    const std::string name = fmt::format("{}_{}", prefix, column_name(info));
    return fmt::format("{0} REAL CHECK (({0} IS NULL) = ({1}))", name, is_absent);
  });
}

std::string error_columns() {
  return for_each_parameter(next_column, [](const ParameterInfo& info) {
    return fmt::format("error_{0} REAL AS (estimate_{0} - truth_{0})", column_name(info));
  });
}

std::string health_columns() {
  std::string text;
  for (const HealthValue& value : health_values()) {
    if (!text.empty()) text += next_column;
    text += fmt::format("health_{}{} REAL", value.name, value.unit_suffix);
  }
  return text;
}

std::string health_of_row() {
  std::string text;
  for (const HealthValue& value : health_values()) {
    if (!text.empty()) text += ",\n       ";
    text += fmt::format("r.health_{0}{1} AS {0}{1}", value.name, value.unit_suffix);
  }
  return text;
}

std::string value_of_parameter(std::string_view prefix) {
  return "CASE p.position" +
         for_each_parameter("",
                            [&](const ParameterInfo& info) {
                              return fmt::format("\n         WHEN {} THEN r.{}_{}",
                                                 index(info.parameter) + 1, prefix,
                                                 column_name(info));
                            }) +
         " END";
}

std::string budget_total() {
  return for_each_parameter("\n       + ", [](const ParameterInfo& info) {
    return fmt::format(
        "abs(error_{}) * (SELECT ifnull(sum(value), 0.0) FROM budget_coefficient"
        " WHERE parameter = '{}')",
        column_name(info), info.name);
  });
}

/// The names of choices that are stored as 1, 2, ...
std::string name_of_choice(std::string_view column, const std::vector<std::string_view>& names) {
  std::string text = fmt::format("CASE r.{}", column);
  std::size_t number = 0;
  for (const std::string_view name : names) {
    text += fmt::format("\n         WHEN {} THEN '{}'", ++number, name);
  }
  return text + " END";
}

template <typename Choice>
std::vector<std::string_view> names_from_1(Choice last) {
  std::vector<std::string_view> names;
  for (int value = 1; value <= static_cast<int>(last); ++value) {
    names.push_back(name_of(static_cast<Choice>(value)));
  }
  return names;
}

std::map<std::string_view, std::string> texts() {
  const std::span<const std::string_view> sessions = names_of(SessionTarget{});
  const std::vector<std::string_view> session_names(sessions.begin(), sessions.end());
  return {
      {"truth_columns", value_columns("truth", "status = 4")},
      {"estimate_columns", value_columns("estimate", "status > 2")},
      {"error_columns", error_columns()},
      {"health_columns", health_columns()},
      {"health_values", health_of_row()},
      {"status_name", name_of_choice("status", names_from_1(RunStatus::lost))},
      {"loss_cause_name", name_of_choice("loss_cause", names_from_1(LossCause::square_noise))},
      {"loss_session_name", name_of_choice("loss_session", session_names)},
      {"truth_of_parameter", value_of_parameter("truth")},
      {"estimate_of_parameter", value_of_parameter("estimate")},
      {"error_of_parameter", value_of_parameter("error")},
      {"budget_total", budget_total()},
      {"num_sessions", std::to_string(sessions.size())},
      {"session_names", fmt::format("{}", fmt::join(session_names, ", "))},
  };
}

}  // namespace

std::string with_quantities(std::string_view sql) {
  const std::map<std::string_view, std::string> replacements = texts();
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
