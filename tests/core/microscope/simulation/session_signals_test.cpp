#include "core/microscope/simulation/session_signals.hpp"

#include <cstring>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/environment/environment.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

const EnvironmentTable no_table;

/// A session of one orbit and what its signals need to live.
struct Fixture {
  Scenario scenario;
  Session session;
  KeplerOrbit orbit{scenario.orbit};
  Environment environment{scenario.environment, no_table, scenario.orbit.period_s};

  Fixture() { session.num_orbits = 1; }
  [[nodiscard]] SessionSignals signals() const { return {scenario, session, orbit, environment}; }
};

struct TimedSample {
  double time_s;
  SharedSample sample;
};

/// Every sample of settling and record, with its time from the session's start.
std::vector<TimedSample> all_samples(const Fixture& fixture) {
  SessionSignals signals = fixture.signals();
  std::vector<TimedSample> samples;
  for (std::int64_t k = -signals.num_settling(); k < signals.num_record(); ++k) {
    samples.push_back({period_s * static_cast<double>(k), signals.next()});
  }
  return samples;
}

double length(const Vector3<double>& v) { return std::sqrt(dot(v, v)); }

TEST(SessionSignals, HaveTheSamplesOfTheirOrbitsAndOfSettling) {
  Fixture fixture;
  EXPECT_EQ(fixture.signals().num_settling(), 16000);
  EXPECT_EQ(fixture.signals().num_record(), 23800);
  fixture.session.num_orbits = 40;
  EXPECT_EQ(fixture.signals().num_record(), 952000);
}

// 5950.1 s are 23800.4 samples; three orbits are 71401.2.
TEST(SessionSignals, CutTheLastOrbitAtAFullSample) {
  Scenario scenario;
  scenario.orbit.period_s = 5950.1;
  Session session;
  session.num_orbits = 1;
  EXPECT_EQ(num_record_samples(scenario, session), 23800);
  session.num_orbits = 3;
  EXPECT_EQ(num_record_samples(scenario, session), 71401);
  // A whole number that rounding puts just below: 0.7 s in 0.1 s samples.
  scenario.orbit.period_s = 0.7;
  scenario.simulation.sample_period_s = 0.1;
  session.num_orbits = 1;
  EXPECT_EQ(num_record_samples(scenario, session), 7);
}

TEST(SessionSignals, StartTheRecordAtPerigee) {
  const Fixture fixture;
  const std::vector<TimedSample> samples = all_samples(fixture);
  const SharedSample& first = samples[16000].sample;
  EXPECT_EQ(samples[16000].time_s, 0.0);
  EXPECT_NEAR(first.radial_I.x, 1.0, 2.3e-16);
  EXPECT_EQ(first.radial_I.z, 0.0);
  EXPECT_LT(samples[15999].sample.radial_I.z, 0.0);
  EXPECT_GT(samples[16001].sample.radial_I.z, 0.0);
}

TEST(SessionSignals, CarryOrbitAndEnvironmentOfTheirTime) {
  const Fixture fixture;
  for (const auto& [time_s, sample] : all_samples(fixture)) {
    const OrbitPoint point = fixture.orbit.at(time_s);
    ASSERT_EQ(sample.gradient_s2, point.gradient_s2);
    ASSERT_EQ(sample.radial_I.x, point.radial_I_x);
    ASSERT_EQ(sample.radial_I.z, point.radial_I_z);
    const ExternalAcceleration external = fixture.environment.at(time_s, point);
    ASSERT_EQ(sample.external_S.linear_m_s2.x, external.linear_m_s2.x);
    ASSERT_EQ(sample.external_S.angular_rad_s2.z, external.angular_rad_s2.z);
  }
}

TEST(SessionSignals, AreStillWithoutExcitation) {
  const Fixture fixture;
  for (const auto& [time_s, sample] : all_samples(fixture)) {
    ASSERT_EQ(length(sample.attitude_command_S_rad), 0.0);
    ASSERT_EQ(length(sample.drag_free_command_S_m_s2), 0.0);
    ASSERT_EQ(sample.mass_motion.acceleration_m_s2, 0.0);
    ASSERT_EQ(length(sample.commanded.angle_RS_S), 0.0);
    ASSERT_EQ(length(sample.omega_IR_R), 0.0);
    ASSERT_EQ(sample.radial_R.x, sample.radial_I.x);
  }
}

// a sin(2πft) with t = 0 at the record's start: the phase runs through settling without a jump.
// Each channel has its own, and so has a second motion of the masses; excitations of one axis add
// up.
TEST(SessionSignals, ExciteAllThatTheSessionShakes) {
  Fixture fixture;
  fixture.session.excitations = {
      {ExcitationKind::test_mass, Axis::y, 1e-5, 9.88e-3},
      {ExcitationKind::drag_free, Axis::y, 2e-8, 1.2e-3},
      {ExcitationKind::drag_free, Axis::y, 1e-8, 3.1e-3},
      {ExcitationKind::test_mass, Axis::z, 2e-5, 3.1e-3},
  };
  const auto sine = [](double amplitude, double frequency_hz, double time_s) {
    return amplitude * std::sin(two_pi * frequency_hz * time_s);
  };
  for (const auto& [time_s, sample] : all_samples(fixture)) {
    ASSERT_NEAR(sample.drag_free_command_S_m_s2.y,
                sine(2e-8, 1.2e-3, time_s) + sine(1e-8, 3.1e-3, time_s), 3e-8 * 1e-12);
    ASSERT_EQ(sample.drag_free_command_S_m_s2.x, 0.0);
    ASSERT_EQ(sample.drag_free_command_S_m_s2.z, 0.0);
    ASSERT_NEAR(sample.second_motion.position_m, sine(2e-5, 3.1e-3, time_s), 2e-5 * 1e-12);
    ASSERT_EQ(length(sample.attitude_command_S_rad), 0.0);
    ASSERT_NEAR(sample.mass_motion.position_m, sine(1e-5, 9.88e-3, time_s), 1e-5 * 1e-12);
  }
}

// Velocity and acceleration are the derivatives of the position: central differences over one
// sample leave (ωT)²/6 = 4e-5 and (ωT)²/12 = 2e-5 of the amplitudes; Richardson's extrapolation
// with two samples leaves the fourth order, (ωT)⁴/30 = 2e-9 and (ωT)⁴/90.
TEST(SessionSignals, MoveTheMassesConsistently) {
  Fixture fixture;
  constexpr double amplitude = 1e-5;
  constexpr double omega = two_pi * 9.88e-3;
  fixture.session.excitations = {
      {ExcitationKind::test_mass, Axis::x, amplitude, 9.88e-3, MassMotion::mass_1}};
  const std::vector<TimedSample> samples = all_samples(fixture);
  const auto position = [&](std::size_t k) { return samples[k].sample.mass_motion.position_m; };
  for (std::size_t k = 2; k + 2 < samples.size(); ++k) {
    const MassMotionPhase& motion = samples[k].sample.mass_motion;
    ASSERT_NEAR(motion.position_m, amplitude * std::sin(omega * samples[k].time_s),
                amplitude * 1e-12);
    const double velocity =
        (8.0 * (position(k + 1) - position(k - 1)) - (position(k + 2) - position(k - 2))) /
        (12.0 * period_s);
    const double acceleration = (16.0 * (position(k + 1) + position(k - 1)) -
                                 (position(k + 2) + position(k - 2)) - 30.0 * position(k)) /
                                (12.0 * period_s * period_s);
    ASSERT_NEAR(motion.velocity_m_s, velocity, amplitude * omega * 1e-8);
    ASSERT_NEAR(motion.acceleration_m_s2, acceleration, amplitude * omega * omega * 1e-8);
  }
}

/// Phasor of x(t) = Re(A e^{iωt}) over whole cycles of `samples` from index `first`.
template <typename Value>
std::complex<double> phasor(const std::vector<TimedSample>& samples, std::size_t first,
                            std::size_t count, double frequency_hz, Value value) {
  std::complex<double> sum = 0.0;
  for (std::size_t k = first; k < first + count; ++k) {
    sum += value(samples[k].sample) * std::polar(1.0, -two_pi * frequency_hz * samples[k].time_s);
  }
  return 2.0 * sum / static_cast<double>(count);
}

// The estimator's low-pass on a star tracker's angles. The double integrator's innovation is
// (z − 1)³/(z − r)³ of them, of which the correction leaves r³: LP = 1 − r³(z − 1)³/(z − r)³. The
// transient of the triple pole, (ω_h t)² e^(−ω_h t), is below 1e-28 after 4000 s.
TEST(SessionSignals, FilterTheCommandLikeTheEstimator) {
  for (const double frequency_hz : {1e-3, 4e-3}) {
    Fixture fixture;
    fixture.session.excitations = {{ExcitationKind::attitude, Axis::z, 3.5e-3, frequency_hz}};
    const std::vector<TimedSample> samples = all_samples(fixture);
    const auto measured = phasor(samples, 16000, 20000, frequency_hz,
                                 [](const SharedSample& s) { return s.commanded.angle_RS_S.z; });
    const std::complex<double> command(0.0, -3.5e-3);

    const std::complex<double> z = std::polar(1.0, two_pi * frequency_hz * period_s);
    const double r = std::exp(-two_pi * 3e-3 * period_s);
    const std::complex<double> high = r * (z - 1.0) / (z - r);
    const std::complex<double> low_pass = 1.0 - high * high * high;
    EXPECT_LT(std::abs(measured / command - low_pass), 1e-10) << frequency_hz;

    // The continuous filter that it samples, to first order in ω_h T = 5e-3.
    const std::complex<double> s(0.0, frequency_hz / 3e-3);
    const std::complex<double> continuous = 1.0 - std::pow(s / (s + 1.0), 3);
    EXPECT_LT(std::abs(low_pass - continuous), 0.02) << frequency_hz;
  }
}

TEST(SessionSignals, CommandTheAttitudeAboutItsAxisInPhaseWithTheRecord) {
  Fixture fixture;
  fixture.session.excitations = {{ExcitationKind::attitude, Axis::y, 3.5e-3, 1e-3}};
  for (const auto& [time_s, sample] : all_samples(fixture)) {
    ASSERT_NEAR(sample.attitude_command_S_rad.y, 3.5e-3 * std::sin(two_pi * 1e-3 * time_s),
                3.5e-3 * 1e-13);
    ASSERT_EQ(sample.attitude_command_S_rad.x, 0.0);
    ASSERT_EQ(length(sample.drag_free_command_S_m_s2), 0.0);
    ASSERT_EQ(sample.commanded.angle_RS_S.x, 0.0);
    ASSERT_EQ(sample.commanded.angle_RS_S.z, 0.0);
  }
}

// The reference turns by Ωt about Y: its quaternion, its rate and the Earth's direction in it,
// which in a frame that follows the orbit (Ω = −n, e = 0) stands still.
TEST(SessionSignals, SpinTheReferenceAboutY) {
  Fixture fixture;
  const double rate = 4.2e-3;
  fixture.session.spin_rate_rad_s = rate;
  for (const auto& [time_s, sample] : all_samples(fixture)) {
    ASSERT_EQ(sample.omega_IR_R.y, rate);
    ASSERT_NEAR(sample.attitude_IR.scalar, std::cos(0.5 * rate * time_s), 1e-13);
    ASSERT_NEAR(sample.attitude_IR.vector.y, std::sin(0.5 * rate * time_s), 1e-13);
    // R = rotation by Ωt about Y: x_R = x cos − z sin, z_R = x sin + z cos.
    const double c = std::cos(rate * time_s);
    const double s = std::sin(rate * time_s);
    const Vector3<double>& u = sample.radial_I;
    ASSERT_NEAR(sample.radial_R.x, c * u.x - s * u.z, 1e-13);
    ASSERT_NEAR(sample.radial_R.y, 0.0, 1e-15);
    ASSERT_NEAR(sample.radial_R.z, s * u.x + c * u.z, 1e-13);
  }
}

// Drag and radiation pressure do not turn with the satellite: in S their vector turns against it.
TEST(SessionSignals, TurnTheHarmonicEnvironmentIntoTheFrameThatSpins) {
  Fixture fixture;
  const auto inertial = all_samples(fixture);
  const double rate = 4.2e-3;
  fixture.session.spin_rate_rad_s = rate;
  const auto spinning = all_samples(fixture);
  for (std::size_t i = 0; i < inertial.size(); ++i) {
    const double c = std::cos(rate * spinning[i].time_s);
    const double s = std::sin(rate * spinning[i].time_s);
    const auto expect_turned = [&](const Vector3<double>& a_I, const Vector3<double>& a_R) {
      ASSERT_NEAR(a_R.x, c * a_I.x - s * a_I.z, 1e-20);
      ASSERT_NEAR(a_R.y, a_I.y, 1e-20);
      ASSERT_NEAR(a_R.z, s * a_I.x + c * a_I.z, 1e-20);
    };
    expect_turned(inertial[i].sample.external_S.linear_m_s2,
                  spinning[i].sample.external_S.linear_m_s2);
    expect_turned(inertial[i].sample.external_S.angular_rad_s2,
                  spinning[i].sample.external_S.angular_rad_s2);
  }
}

TEST(SessionSignals, AreTheSameBitsManyAtATime) {
  Fixture fixture;
  fixture.session.excitations = {{ExcitationKind::attitude, Axis::y, 3.5e-3, 1e-3}};
  fixture.session.spin_rate_rad_s = 4.2e-3;
  SessionSignals many = fixture.signals();
  SessionSignals one = fixture.signals();
  std::array<SamplePhases, 7> phases;
  std::array<SharedSample, 7> samples;
  for (int round = 0; round < 3000; ++round) {
    for (std::size_t i = 0; i < phases.size(); ++i) {
      phases[i] = many.phases_at(many.time_s(i)).value();
    }
    many.next(phases, samples);
    for (const SharedSample& sample : samples) {
      const SharedSample expected = one.next();
      static_assert(sizeof(SharedSample) % sizeof(double) == 0);
      ASSERT_EQ(std::memcmp(&sample, &expected, sizeof sample), 0) << round;
    }
  }
}

/// X acceleration of two orbits at some times, from a file of `num_rows` rows that ramps by 1e-9
/// m/s² every 50 s.
std::vector<double> tabulated(int num_rows, const std::vector<double>& times_s) {
  Fixture fixture;
  fixture.session.num_orbits = 2;
  fixture.scenario.environment.kind = EnvironmentKind::file;
  EnvironmentTable rows;
  for (int k = 0; k < num_rows; ++k) rows.push_back({50.0 * k, {1e-9 * k, 0.0, 0.0}, {}});
  fixture.environment = Environment(fixture.scenario.environment, rows, 5950.0);
  const std::vector<TimedSample> samples = all_samples(fixture);
  std::vector<double> values;
  for (const double time_s : times_s) {
    const auto position = static_cast<std::size_t>((time_s + 4000.0) / period_s);
    values.push_back(samples[position].sample.external_S.linear_m_s2.x);
  }
  return values;
}

// The session's end decides whether the file or its first orbit is followed: 6000 s are too short
// for two orbits, 12000 s are not.
TEST(SessionSignals, FollowAnEnvironmentFileThatIsLongEnoughAndRepeatOthers) {
  for (const int num_rows : {121, 241}) {
    const std::vector<double> values = tabulated(num_rows, {-4000.0, 1000.0, 6950.0});
    EXPECT_NEAR(values[0], 39e-9, 1e-21);
    EXPECT_NEAR(values[1], 20e-9, 1e-21);
    EXPECT_NEAR(values[2], num_rows == 121 ? 20e-9 : 139e-9, 1e-21);
  }
}

}  // namespace
}  // namespace proofmass
