#include "core/environment/environment_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "core/error.hpp"

namespace proofmass {
namespace {

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

}  // namespace proofmass
