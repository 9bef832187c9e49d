#include "core/microscope/environment/environment_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
namespace {

constexpr std::string_view environment_key = "environment.file";
constexpr std::size_t values_per_row = 7;

void check_shape(const DataTable& table) {
  if (table.num_columns == values_per_row && table.values.size() % values_per_row == 0) return;
  throw DefinitionError(
      fmt::format("definition.tables = {} values in {} columns (must be rows of {})",
                  table.values.size(), table.num_columns, values_per_row));
}

[[noreturn]] void refuse_row(std::size_t position, double value, std::string_view rule) {
  throw ConfigError(fmt::format("environment.file row {}", position + 1), fmt::format("{}", value),
                    rule);
}

void check_finite(const EnvironmentTable& table) {
  const auto check = [](std::size_t position, double value) {
    if (!std::isfinite(value)) refuse_row(position, value, "must be finite");
  };
  for (std::size_t i = 0; i < table.size(); ++i) {
    check(i, table[i].time_s);
    for (const double value : table[i].linear_m_s2) check(i, value);
    for (const double value : table[i].angular_rad_s2) check(i, value);
  }
}

void check_times(const EnvironmentTable& table, double orbit_period_s) {
  if (table.front().time_s > 0.0) {
    refuse_row(0, table.front().time_s, "the first time_s must be <= 0");
  }
  for (std::size_t i = 1; i < table.size(); ++i) {
    if (table[i].time_s > table[i - 1].time_s) continue;
    refuse_row(i, table[i].time_s,
               fmt::format("time_s must be > {}, that of the row before", table[i - 1].time_s));
  }
  if (table.back().time_s < orbit_period_s) {
    refuse_row(table.size() - 1, table.back().time_s,
               fmt::format("the last time_s must be >= one orbit, {} s", orbit_period_s));
  }
}

}  // namespace

void validate_environment_table(const EnvironmentTable& table, double orbit_period_s) {
  if (table.size() < 2 || table.size() > environment_rows_max) {
    throw ConfigError("environment.file", fmt::format("{} rows", table.size()),
                      fmt::format("must have 2 to {}", environment_rows_max));
  }
  check_finite(table);
  check_times(table, orbit_period_s);
}

DataTableSchema environment_table_schema() {
  return {
      .key = environment_key,
      .table = "environment_row",
      .comment = "The environment file. Accelerations in the satellite frame, time from perigee.",
      .columns = {"time_s", "linear_x_m_s2", "linear_y_m_s2", "linear_z_m_s2", "angular_x_rad_s2",
                  "angular_y_rad_s2", "angular_z_rad_s2"}};
}

std::vector<DataTable> tables_of(const EnvironmentTable& environment) {
  if (environment.empty()) return {};
  DataTable table{.key = std::string(environment_key), .num_columns = values_per_row, .values = {}};
  table.values.reserve(environment.size() * values_per_row);
  for (const EnvironmentRow& row : environment) {
    table.values.push_back(row.time_s);
    table.values.insert(table.values.end(), row.linear_m_s2.begin(), row.linear_m_s2.end());
    table.values.insert(table.values.end(), row.angular_rad_s2.begin(), row.angular_rad_s2.end());
  }
  return {std::move(table)};
}

EnvironmentTable environment_of(const std::vector<DataTable>& tables) {
  if (tables.empty()) return {};
  if (tables.size() > 1 || tables.front().key != environment_key) {
    throw DefinitionError(fmt::format("definition.tables = {:.100}{} (must be {} alone)",
                                      tables.front().key, tables.size() > 1 ? ", ..." : "",
                                      environment_key));
  }
  check_shape(tables.front());
  const std::vector<double>& values = tables.front().values;
  EnvironmentTable rows(values.size() / values_per_row);
  auto next = values.begin();
  for (EnvironmentRow& row : rows) {
    row.time_s = *next++;
    for (double& value : row.linear_m_s2) value = *next++;
    for (double& value : row.angular_rad_s2) value = *next++;
  }
  return rows;
}

}  // namespace proofmass
