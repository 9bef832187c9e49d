#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/campaign/definition.hpp"
#include "core/campaign/result_schema.hpp"

namespace proofmass {

/// External accelerations at one time, in S.
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

/// The rows as a table of a Definition, in columns of that schema.
[[nodiscard]] DataTableSchema environment_table_schema();
[[nodiscard]] std::vector<DataTable> tables_of(const EnvironmentTable& environment);
/// @throws DefinitionError unless these are the tables of some environment, of any numbers.
[[nodiscard]] EnvironmentTable environment_of(const std::vector<DataTable>& tables);

/// Checks that every value is finite, times ascend, the first is at most 0 and the last at least
/// one orbit. A table shorter than a session is repeated every orbit.
/// @throws ConfigError naming `environment.file row i`, i from 1.
void validate_environment_table(const EnvironmentTable& table, double orbit_period_s);

}  // namespace proofmass
