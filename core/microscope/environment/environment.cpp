#include "core/microscope/environment/environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

Vector3<double> lerp(const std::array<double, 3>& a, const std::array<double, 3>& b, double part) {
  const auto between = [part](double from, double to) { return from + part * (to - from); };
  return {between(a[0], b[0]), between(a[1], b[1]), between(a[2], b[2])};
}

}  // namespace

std::span<const std::string_view> names_of(EnvironmentKind) {
  static constexpr std::array<std::string_view, 2> names{"harmonic", "file"};
  return names;
}

// Drag and radiation pressure in inertial pointing, at the level that leaves the mission's
// drag-free residue of 1e-12 m/s². The sines are cosines a quarter of a turn late.
EnvironmentConfig::EnvironmentConfig() {
  constexpr double sine = -std::numbers::pi / 2;
  linear_x = {5e-9, 1e-8, 0.0, 3e-9, 0.3};
  linear_y = {0.0, 3e-9, sine, 0.0, 0.0};
  linear_z = {0.0, 1e-8, sine, 3e-9, sine};
  angular_x = angular_y = angular_z = {0.0, 1e-8, 0.0, 0.0, 0.0};
}

Environment::Environment(const EnvironmentConfig& config, const EnvironmentTable& table,
                         double orbit_period_s)
    : kind_(config.kind), scale_(config.scale), orbit_period_s_(orbit_period_s), table_(&table) {
  const std::array<const HarmonicAxis*, 6> axes{&config.linear_x,  &config.linear_y,
                                                &config.linear_z,  &config.angular_x,
                                                &config.angular_y, &config.angular_z};
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const HarmonicAxis& axis = *axes[i];
    const SineCosine once = sincos(axis.orbital_phase_rad);
    const SineCosine twice = sincos(axis.twice_orbital_phase_rad);
    harmonics_[i] = {scale_ * axis.mean, scale_ * axis.orbital * once.cosine,
                     -scale_ * axis.orbital * once.sine, scale_ * axis.twice_orbital * twice.cosine,
                     -scale_ * axis.twice_orbital * twice.sine};
  }
}

bool Environment::is_periodic(double end_s) const {
  return kind_ == EnvironmentKind::file && table_->back().time_s < end_s;
}

ExternalAcceleration Environment::at(double time_s, const OrbitPoint& point) const {
  if (kind_ == EnvironmentKind::file) return interpolate(time_s);
  const double c = point.mean_anomaly.cosine;
  const double s = point.mean_anomaly.sine;
  const double c2 = c * c - s * s;
  const double s2 = 2.0 * s * c;
  const auto value = [&](std::size_t i) {
    const Harmonic& h = harmonics_[i];
    return h.mean + h.cosine * c + h.sine * s + h.twice_cosine * c2 + h.twice_sine * s2;
  };
  return {{value(0), value(1), value(2)}, {value(3), value(4), value(5)}};
}

ExternalAcceleration Environment::interpolate(double time_s) const {
  // Before a session's record the loops settle on the orbit before: that part repeats the first
  // one.
  double t = time_s;
  if (periodic_ || t < table_->front().time_s) {
    // Rounding may leave the remainder just below 0.
    t = std::fmax(t - std::floor(t / orbit_period_s_) * orbit_period_s_, table_->front().time_s);
  }
  const auto after =
      std::upper_bound(table_->begin(), table_->end(), t,
                       [](double value, const EnvironmentRow& row) { return value < row.time_s; });
  if (after == table_->end()) {
    const EnvironmentRow& last = table_->back();
    return {scale_ * lerp(last.linear_m_s2, last.linear_m_s2, 0.0),
            scale_ * lerp(last.angular_rad_s2, last.angular_rad_s2, 0.0)};
  }
  PROOFMASS_EXPECT(after != table_->begin());
  const EnvironmentRow& next = *after;
  const EnvironmentRow& row = *(after - 1);
  const double part = (t - row.time_s) / (next.time_s - row.time_s);
  return {scale_ * lerp(row.linear_m_s2, next.linear_m_s2, part),
          scale_ * lerp(row.angular_rad_s2, next.angular_rad_s2, part)};
}

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
