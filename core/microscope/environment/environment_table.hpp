#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass {

/// A row of an environment file, whose columns the fields are named after. In S.
struct EnvironmentRow {
  double time_s = 0.0;                     ///< From perigee.
  std::array<double, 3> linear_m_s2{};     ///< x, y, z.
  std::array<double, 3> angular_rad_s2{};  ///< x, y, z.

  bool operator==(const EnvironmentRow&) const = default;
};

/// Rows of an environment file, times ascending.
using EnvironmentTable = std::vector<EnvironmentRow>;

/// Most rows that a table may have: 40 orbits every 10 s have 24,000.
inline constexpr std::size_t environment_rows_max = 200'000;

/// Checks that the table has 2 to environment_rows_max rows, that every value is finite, that times
/// ascend, that the first is at most 0 and the last at least one orbit.
/// @throws ConfigError naming `environment.file row i`, i from 1.
void validate_environment_table(const EnvironmentTable& table, double orbit_period_s);

/// Key, columns and meaning of the table by which a Definition carries the rows.
[[nodiscard]] DataTableSchema environment_table_schema();

/// The rows as that table; no table if there are no rows.
[[nodiscard]] std::vector<DataTable> tables_of(const EnvironmentTable& environment);

/// The rows of those tables. Their values may be any numbers: validate_environment_table() checks
/// them.
/// @throws DefinitionError unless there is no table, or one of the right key and shape.
[[nodiscard]] EnvironmentTable environment_of(const std::vector<DataTable>& tables);

}  // namespace proofmass
