#include "core/microscope/environment/environment.hpp"

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double orbit_period_s = 5950.0;
const KeplerOrbit orbit({.period_s = orbit_period_s, .eccentricity = 5e-3});
const EnvironmentTable no_table;

ExternalAcceleration value_at(const Environment& environment, double time_s) {
  return environment.at(time_s, orbit.at(time_s));
}

void expect_components(const Vector3<double>& actual, const std::array<double, 3>& expected,
                       double tolerance) {
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(actual[i], expected[i], tolerance) << "axis " << i;
}

// The nominal environment of the model, written out. Rounding: 1e-15 of 2e-8.
TEST(HarmonicEnvironment, IsTheNominalOneByDefault) {
  const Environment environment(EnvironmentConfig{}, no_table, orbit_period_s);
  for (int k = -100; k < 100; ++k) {
    const double t = 71.3 * k;
    const double m = 2.0 * std::numbers::pi * t / orbit_period_s;
    const ExternalAcceleration value = value_at(environment, t);
    expect_components(value.linear_m_s2,
                      {5e-9 + 1e-8 * std::cos(m) + 3e-9 * std::cos(2 * m + 0.3), 3e-9 * std::sin(m),
                       1e-8 * std::sin(m) + 3e-9 * std::sin(2 * m)},
                      1e-22);
    const double angular = 1e-8 * std::cos(m);
    expect_components(value.angular_rad_s2, {angular, angular, angular}, 1e-22);
  }
}

// Amplitudes and phases that differ on every axis, so that none can stand in for another.
TEST(HarmonicEnvironment, FollowsEachAxisOfItsConfiguration) {
  EnvironmentConfig config;
  config.scale = 4.0;
  std::array<HarmonicAxis*, 6> axes{&config.linear_x,  &config.linear_y,  &config.linear_z,
                                    &config.angular_x, &config.angular_y, &config.angular_z};
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const auto x = static_cast<double>(i + 1);
    *axes[i] = {0.1 * x, 1.0 * x, 0.3 * x, 2.0 * x, -0.7 * x};
  }
  const Environment environment(config, no_table, orbit_period_s);
  for (const double t : {-4000.0, 0.0, 1.0, 1000.0, 5000.0, 23800.25}) {
    const double m = 2.0 * std::numbers::pi * t / orbit_period_s;
    const ExternalAcceleration value = value_at(environment, t);
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const HarmonicAxis& axis = *axes[i];
      const double expected = axis.mean + axis.orbital * std::cos(m + axis.orbital_phase_rad) +
                              axis.twice_orbital * std::cos(2 * m + axis.twice_orbital_phase_rad);
      const double actual = i < 3 ? value.linear_m_s2[i] : value.angular_rad_s2[i - 3];
      EXPECT_NEAR(actual, 4.0 * expected, 12e-13) << "axis " << i << " at " << t;
    }
  }
}

/// Rows every 50 s from `first_s`, whose values are distinct for each row and column.
EnvironmentTable table(double first_s, double last_s) {
  EnvironmentTable rows;
  for (double t = first_s; t <= last_s; t += 50.0) {
    const double x = std::sin(0.01 * t) * 1e-8;
    rows.push_back({t, {x, 2.0 * x + 1e-9, -x}, {x * x * 1e8, 5e-9 - x, 3.0 * x}});
  }
  return rows;
}

EnvironmentConfig from_file(double scale = 1.0) {
  EnvironmentConfig config;
  config.kind = EnvironmentKind::file;
  config.scale = scale;
  return config;
}

TEST(TabulatedEnvironment, IsLinearBetweenItsRows) {
  const EnvironmentTable rows = table(0.0, 6000.0);
  const Environment environment(from_file(3.0), rows, orbit_period_s);
  for (std::size_t k = 0; k + 2 < rows.size(); ++k) {
    for (const double part : {0.0, 0.125, 0.5, 0.995}) {
      const ExternalAcceleration value = value_at(environment, rows[k].time_s + 50.0 * part);
      for (std::size_t i = 0; i < 3; ++i) {
        const double linear =
            (1.0 - part) * rows[k].linear_m_s2[i] + part * rows[k + 1].linear_m_s2[i];
        const double angular =
            (1.0 - part) * rows[k].angular_rad_s2[i] + part * rows[k + 1].angular_rad_s2[i];
        EXPECT_NEAR(value.linear_m_s2[i], 3.0 * linear, 1e-21) << rows[k].time_s;
        EXPECT_NEAR(value.angular_rad_s2[i], 3.0 * angular, 1e-21) << rows[k].time_s;
      }
    }
  }
}

void expect_equal(const ExternalAcceleration& a, const ExternalAcceleration& b) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(a.linear_m_s2[i], b.linear_m_s2[i]);
    EXPECT_EQ(a.angular_rad_s2[i], b.angular_rad_s2[i]);
  }
}

// The first orbit repeats, although the table goes on for another half.
TEST(TabulatedEnvironment, RepeatsItsFirstOrbitIfItEndsBeforeTheSession) {
  const EnvironmentTable rows = table(0.0, 9000.0);
  Environment environment(from_file(), rows, orbit_period_s);
  EXPECT_TRUE(environment.is_periodic(59500.0));
  environment.begin_session(59500.0);
  for (const double t : {0.0, 12.5, 3000.0, 5949.75}) {
    const ExternalAcceleration first = value_at(environment, t);
    for (const int orbits : {1, 2, 9}) {
      expect_equal(value_at(environment, t + orbits * orbit_period_s), first);
    }
  }
}

TEST(TabulatedEnvironment, IsFollowedToItsEndIfItCoversTheSession) {
  const EnvironmentTable rows = table(0.0, 12000.0);
  Environment environment(from_file(), rows, orbit_period_s);
  EXPECT_FALSE(environment.is_periodic(11900.0));
  EXPECT_FALSE(environment.is_periodic(12000.0));
  EXPECT_TRUE(environment.is_periodic(12000.25));
  environment.begin_session(11900.0);
  EXPECT_EQ(value_at(environment, 10000.0).linear_m_s2.x, rows[200].linear_m_s2[0]);
  EXPECT_NE(rows[200].linear_m_s2[0],
            value_at(environment, 10000.0 - orbit_period_s).linear_m_s2.x);
  // Beyond the last row, its values stay.
  EXPECT_EQ(value_at(environment, 12001.0).linear_m_s2.x, rows.back().linear_m_s2[0]);
}

// While the loops settle, the time is negative: the table's own rows if it has them, else the orbit
// before is the first one.
TEST(TabulatedEnvironment, HasValuesBeforeTheSession) {
  const EnvironmentTable from_zero = table(0.0, 12000.0);
  Environment wrapped(from_file(), from_zero, orbit_period_s);
  wrapped.begin_session(11900.0);
  expect_equal(value_at(wrapped, -4000.0), value_at(wrapped, orbit_period_s - 4000.0));

  const EnvironmentTable from_before = table(-5000.0, 12000.0);
  Environment followed(from_file(), from_before, orbit_period_s);
  followed.begin_session(11900.0);
  EXPECT_EQ(value_at(followed, -4000.0).linear_m_s2.x, from_before[20].linear_m_s2[0]);
}

TEST(HarmonicEnvironment, IsNeverCalledPeriodicByItsTable) {
  const Environment environment(EnvironmentConfig{}, no_table, orbit_period_s);
  EXPECT_FALSE(environment.is_periodic(1e9));
}

// 10 orbits of 5900.8 s sampled every 0.3 s: here t − ⌊t/P⌋P rounds to just below 0, before the
// table's first row.
TEST(EnvironmentTable, IsReadWhereTheOrbitBeginsAnew) {
  EnvironmentConfig config;
  config.kind = EnvironmentKind::file;
  const EnvironmentTable table{{.time_s = 0.0, .linear_m_s2 = {1.0, 0.0, 0.0}},
                               {.time_s = 6000.0, .linear_m_s2 = {2.0, 0.0, 0.0}}};
  Environment environment(config, table, 5900.8);
  environment.begin_session(10 * 5900.8);
  EXPECT_DOUBLE_EQ(environment.at(177024 * 0.3, OrbitPoint{}).linear_m_s2.x, 1.0);
}

EnvironmentTable valid_table() { return {{0.0, {}, {}}, {3000.0, {}, {}}, {5950.0, {}, {}}}; }

std::string refusal(const EnvironmentTable& table) {
  return test::message_of<ConfigError>([&] { validate_environment_table(table, orbit_period_s); });
}

TEST(EnvironmentTable, MayCoverJustOneOrbitAndStartBeforeTheSession) {
  EnvironmentTable table = valid_table();
  EXPECT_EQ(refusal(table), "");
  table.front().time_s = -100.0;
  EXPECT_EQ(refusal(table), "");
}

TEST(EnvironmentTable, HasALimitOfRows) {
  EnvironmentTable table(environment_rows_max + 1);
  for (std::size_t i = 0; i < table.size(); ++i) table[i].time_s = static_cast<double>(i);
  EXPECT_EQ(refusal(table), "environment.file = 200001 rows (must have 2 to 200000)");
  table.pop_back();
  EXPECT_EQ(refusal(table), "");
}

TEST(EnvironmentTable, RefusesWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EnvironmentTable table = valid_table();
  table[1].time_s = nan;
  EXPECT_EQ(refusal(table), "environment.file row 2 = nan (must be finite)");
  table = valid_table();
  table[0].linear_m_s2[2] = infinity;
  EXPECT_EQ(refusal(table), "environment.file row 1 = inf (must be finite)");
  table = valid_table();
  table[2].angular_rad_s2[1] = -infinity;
  EXPECT_EQ(refusal(table), "environment.file row 3 = -inf (must be finite)");
}

}  // namespace

}  // namespace proofmass
