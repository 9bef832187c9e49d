#include "core/microscope/simulation/loop.hpp"

#include "core/microscope/environment/environment.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"
#include "core/microscope/simulation/session_record.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

Scenario silent_scenario() {
  Scenario scenario;
  scenario.noise.scale = 0.0;
  scenario.environment.scale = 0.0;
  return scenario;
}

Session quiet_session() {
  return {.name = "quiet",
          .target = SessionTarget::a_c11_delta_x,
          .num_orbits = 1,
          .excitations = {},
          .fit_lines = {{2, 0}},
          .known_lines = {}};
}

// Without torque the rate is constant and the attitude turns about it: after a time t the
// quaternion is (cos ½Ωt, axis sin ½Ωt), of unit length. Rounding of N steps is at most N·2⁻⁵³ or
// so.
TEST(LoopRotation, ConservesATorqueFreeMotion) {
  Loop<double> loop;
  const Vector3<double> rate{0.006, -0.008, 0.0005};
  const double speed = std::sqrt(dot(rate, rate));
  loop.omega_IS_S = rate;
  constexpr int num_steps = 100000;
  for (int k = 0; k < num_steps; ++k) loop.rotate(zero, period_s);
  const double half = 0.5 * speed * period_s * num_steps;
  const double tolerance = 1e-11;
  EXPECT_EQ(loop.omega_IS_S.x, rate.x);
  EXPECT_NEAR(loop.attitude_IS.scalar, std::cos(half), tolerance);
  EXPECT_NEAR(loop.attitude_IS.vector.y, std::sin(half) * rate.y / speed, tolerance);
  const double norm = loop.attitude_IS.scalar * loop.attitude_IS.scalar +
                      dot(loop.attitude_IS.vector, loop.attitude_IS.vector);
  EXPECT_NEAR(norm, 1.0, 1e-15);
}

// About a fixed axis the angle is ½αt².
TEST(LoopRotation, IntegratesAConstantAccelerationExactly) {
  Loop<double> loop;
  constexpr double acceleration = 1e-6;
  constexpr int num_steps = 4000;
  for (int k = 0; k < num_steps; ++k) loop.rotate({0.0, 0.0, acceleration}, period_s);
  const double t = num_steps * period_s;
  EXPECT_NEAR(2.0 * std::asin(loop.attitude_IS.vector.z), 0.5 * acceleration * t * t, 1e-13);
  EXPECT_NEAR(loop.omega_IS_S.z, acceleration * t, 1e-15);
}

// With a changing axis one step of T agrees with many of T/n much better than the commutator term
// T³/12·Ω∧Ω̇ that it includes is large: what follows in the series is smaller by T|Ω|.
TEST(LoopRotation, FollowsATurningAxis) {
  const Vector3<double> rate{0.02, 0.0, 0.0};
  const Vector3<double> acceleration{0.0, 4e-3, 0.0};
  Loop<double> coarse;
  coarse.omega_IS_S = rate;
  coarse.rotate(acceleration, period_s);
  Loop<double> fine;
  fine.omega_IS_S = rate;
  constexpr int num_parts = 1000;
  for (int k = 0; k < num_parts; ++k) fine.rotate(acceleration, period_s / num_parts);
  const Vector3<double> difference = coarse.attitude_IS.vector - fine.attitude_IS.vector;
  const double commutator = 0.5 * std::pow(period_s, 3) / 12.0 * 0.02 * 4e-3;
  EXPECT_LT(std::sqrt(dot(difference, difference)), period_s * 0.02 * commutator);
}

/// Amplitude of the measured common acceleration along X for a unit external acceleration,
/// relative.
/// @param resonance_gains  Of the loop's resonator; none by default.
double measured_rejection(double frequency_hz, const ResonatorGains& resonance_gains = {}) {
  const Scenario scenario = silent_scenario();
  const LoopConstants<double> constants =
      make_loop_constants(make_instrument({}), scenario, quiet_session());
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  const int samples = static_cast<int>(std::lround(1.0 / (frequency_hz * period_s)));
  const double step = two_pi / samples;
  Loop<double> loop;
  Resonator<double> resonator;
  const auto shaping = [&](const Vector3<double>& input_S) {
    return resonator.advance(resonance_gains, input_S);
  };
  SharedSample shared;
  std::complex<double> sum = 0.0;
  const int num_settling = 16000;
  for (int k = 0; k < num_settling + samples; ++k) {
    shared.external_S.linear_m_s2.x = 1e-8 * std::cos(step * k);
    const Observation<double> observation =
        loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{}, Watch::yes,
                     NoViolation{}, shaping);
    const double common = 0.5 * (observation.measured_K[0].x + observation.measured_K[1].x);
    if (k >= num_settling) sum += common * std::polar(1.0, -step * k);
  }
  return std::abs(sum) * 2.0 / samples / 1e-8;
}

// The whole loop around a perfect instrument rejects |1/(1 + L)| of an external acceleration, with
// L(z) = z⁻¹ ω_cT/(1 − z⁻¹)·(1 + ω_iT/(1 − z⁻¹)). At f_orb rejection is 1e-4, which turns the
// nominal 1e-8 m/s² into the paper's 1e-12.
TEST(Loop, RejectsExternalAccelerationsAsTheSampledLoopSays) {
  const DragFreeConfig config;
  for (const double wanted_hz : {1.0 / 5950.0, 1e-3, 0.01, 0.05, 0.1, 0.5}) {
    const double frequency_hz = 1.0 / (period_s * std::round(1.0 / (wanted_hz * period_s)));
    const std::complex<double> delay = std::polar(1.0, -two_pi * frequency_hz * period_s);
    const std::complex<double> open =
        delay * two_pi * config.bandwidth_hz * period_s / (1.0 - delay) *
        (1.0 + two_pi * config.integral_hz * period_s / (1.0 - delay));
    const double expected = 1.0 / std::abs(1.0 + open);
    EXPECT_NEAR(measured_rejection(frequency_hz) / expected, 1.0, 1e-6) << frequency_hz;
  }
  EXPECT_LT(measured_rejection(1.0 / 5950.0), 1.2e-4);
}

// With a resonator L is 1 + 2ζω_0T (1 − z⁻¹ cos ω_0T)/(1 − 2z⁻¹ cos ω_0T + z⁻²) times as large, and
// at ω_0 nothing is left: e^(−ζω_0 · 4000 s) of it after the settling, 6e-18, and rounding.
TEST(Loop, RejectsALineAltogetherWithAResonator) {
  const DragFreeConfig config;
  const double resonance_hz = 1.0 / (period_s * 1286);  // 3.11 mHz, f_EP at V3.
  constexpr double damping = 0.5;
  const ResonatorGains gains = resonator_gains(damping, resonance_hz, period_s);
  for (const int samples : {8000, 1500, 1100, 400, 8}) {
    const double frequency_hz = 1.0 / (period_s * samples);
    const std::complex<double> delay = std::polar(1.0, -two_pi * frequency_hz * period_s);
    const double step = two_pi * resonance_hz * period_s;
    const std::complex<double> open =
        delay * two_pi * config.bandwidth_hz * period_s / (1.0 - delay) *
        (1.0 + two_pi * config.integral_hz * period_s / (1.0 - delay)) *
        (1.0 + 2.0 * damping * step * (1.0 - delay * std::cos(step)) /
                   (1.0 - 2.0 * delay * std::cos(step) + delay * delay));
    const double expected = 1.0 / std::abs(1.0 + open);
    EXPECT_NEAR(measured_rejection(frequency_hz, gains) / expected, 1.0, 1e-6) << samples;
  }
  EXPECT_GT(measured_rejection(resonance_hz), 0.01);
  EXPECT_LT(measured_rejection(resonance_hz, gains), 1e-9);
}

// A command of the session moves the satellite so that the common measurement is its opposite,
// within the loop's |1/(1 + L)|.
TEST(Loop, FollowsTheSessionsCommand) {
  const Scenario scenario = silent_scenario();
  const LoopConstants<double> constants =
      make_loop_constants(make_instrument({}), scenario, quiet_session());
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  Loop<double> loop;
  SharedSample shared;
  shared.drag_free_command_S_m_s2 = {2e-8, 0.0, 0.0};
  Observation<double> observation;
  for (int k = 0; k < 8000; ++k) {
    observation = loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{});
  }
  EXPECT_NEAR(observation.measured_K[0].x, -2e-8, 1e-14);
}

// Spinning about Y at Ω with perfect sensors, X points to ν + Ωt from the Earth, so on a circular
// orbit T_xx = n²(3 cos²(ν + Ωt) − 1), and In_xx = −Ω². A perfect instrument measures ½[T − In]_xx
// Δx exactly.
TEST(Loop, SpinsAsTheClosedFormSays) {
  Scenario scenario = silent_scenario();
  scenario.orbit.eccentricity = 0.0;
  Session session = quiet_session();
  session.spin_rate_rad_s = 4.7552e-3;  // 4.5 turns an orbit.
  Instrument instrument = make_instrument({});
  instrument.offcentring_S_m = {20e-6, 0.0, 0.0};
  const LoopConstants<double> constants = make_loop_constants(instrument, scenario, session);
  const KeplerOrbit orbit(scenario.orbit);
  const EnvironmentTable no_table;
  SessionSignals signals(scenario, session, orbit,
                         Environment(scenario.environment, no_table, orbit.period_s()));
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  Loop<double> loop;
  loop.begin(signals.reference_at_start());
  const double n2 = orbit.mean_motion_rad_s() * orbit.mean_motion_rad_s();
  for (std::int64_t i = -signals.num_settling(); i < signals.num_record(); ++i) {
    const SharedSample shared = signals.next();
    const Observation<double> observation =
        loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{});
    if (i < 0) continue;
    const double t = static_cast<double>(i) * period_s;
    const double phase = (orbit.mean_motion_rad_s() + session.spin_rate_rad_s) * t;
    const double t_xx = n2 * (3.0 * std::cos(phase) * std::cos(phase) - 1.0);
    const double spin2 = session.spin_rate_rad_s * session.spin_rate_rad_s;
    const double expected = 0.5 * (t_xx + spin2) * 20e-6;
    const double measured = 0.5 * (observation.measured_K[0].x - observation.measured_K[1].x);
    // Attitude errors of the settled loop are rounding; 1e-9 of the largest gradient.
    ASSERT_NEAR(measured, expected, 1e-9 * 0.5 * (2.0 * n2 + spin2) * 20e-6) << t;
    // The ground's gradient comes from the estimated attitude and is the true one here.
    const auto values = ground_signals(observation, shared, Product::none);
    ASSERT_NEAR(values[index(Signal::gradient_xx)], t_xx + spin2, 1e-9 * (2.0 * n2 + spin2)) << t;
  }
}

// r_k = place of the unit + drawn offset ∓ ½Δ.
TEST(LoopConstants, PutTheUnitAtItsPlace) {
  Scenario scenario = silent_scenario();
  scenario.sensor.position_m = {0.5, 0.25, -0.5};
  Instrument instrument = make_instrument({});
  instrument.centre_offset_S_m = {0.0, 0.125, 0.0};
  instrument.offcentring_S_m = {0.0, 0.0, 0.25};
  const LoopConstants<double> constants =
      make_loop_constants(instrument, scenario, quiet_session());
  const Vector3<double>& inner = constants.sensors[0].rest_position_S_m;
  const Vector3<double>& outer = constants.sensors[1].rest_position_S_m;
  EXPECT_EQ(inner.x, 0.5);
  EXPECT_EQ(inner.y, 0.375);
  EXPECT_EQ(inner.z, -0.625);
  EXPECT_EQ(outer.z, -0.375);
}

// Masses that move by ∓½Δ_TM sin(ωt) along Y accelerate by ±½ω²Δ_TM sin(ωt) and push their sensors
// by −(k/m) q: of perfect sensors, Γ_mes,dy = ¼(2ω² + k_1/m_1 + k_2/m_2) Δ_TM sin(ωt), and the loop
// does not come in. T_yy = −n² is 6e-6 of that.
TEST(Loop, MeasuresTheForceOfStiffElectrodes) {
  Scenario scenario = silent_scenario();
  scenario.sensor.radial_stiffness_s2 = {-0.05, -0.3};
  Session session = quiet_session();
  session.target = SessionTarget::a_c12;
  session.excitations = {{ExcitationKind::test_mass, Axis::y, 1e-5, 9.88e-3}};
  const LoopConstants<double> constants =
      make_loop_constants(make_instrument({}), scenario, session);
  const KeplerOrbit orbit(scenario.orbit);
  const EnvironmentTable no_table;
  SessionSignals signals(scenario, session, orbit,
                         Environment(scenario.environment, no_table, orbit.period_s()));
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  Loop<double> loop;
  loop.begin(signals.reference_at_start());
  const double omega = two_pi * 9.88e-3;
  const double expected = 0.25 * (2.0 * omega * omega - 0.35) * 1e-5;
  for (std::int64_t i = -signals.num_settling(); i < 1000; ++i) {
    const SharedSample shared = signals.next();
    const Observation<double> observation = loop.advance<TestMasses::moving_twice>(
        constants, drag_free, attitude, shared, SampleNoise<double>{});
    const double t = static_cast<double>(i) * period_s;
    const double measured = 0.5 * (observation.measured_K[0].y - observation.measured_K[1].y);
    ASSERT_NEAR(measured, expected * std::sin(omega * t), 2e-5 * std::abs(expected)) << t;
  }
}

// A commanded swing about Z: the ground takes the command out of the on-board angles, so that its
// gradients are those of the true attitude: T_xy + Ω̇_z with T_xy = (μ/r³)·3 û_x û_y in S.
TEST(GroundSignals, SeeTheTrueAttitudeUnderACommandedSwing) {
  const Scenario scenario = silent_scenario();
  Session session = quiet_session();
  session.excitations = {{.kind = ExcitationKind::attitude,
                          .axis = Axis::z,
                          .amplitude = 3.5e-3,
                          .frequency_hz = 1e-3}};
  const KeplerOrbit orbit(scenario.orbit);
  const EnvironmentTable no_table;
  SessionSignals signals(scenario, session, orbit,
                         Environment(scenario.environment, no_table, orbit.period_s()));
  const LoopConstants<double> constants =
      make_loop_constants(make_instrument({}), scenario, session);
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  Loop<double> loop;
  loop.begin(signals.reference_at_start());
  double largest = 0.0;
  for (std::int64_t i = -signals.num_settling(); i < signals.num_record(); ++i) {
    const SharedSample shared = signals.next();
    const Vector3<double> u = to_target(loop.attitude_IS, shared.radial_I);
    const Observation<double> observation =
        loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{});
    if (i < 0) continue;
    const double expected =
        3.0 * shared.gradient_s2 * u.x * u.y + observation.measured_omega_dot_IS_S.z;
    const auto values = ground_signals(observation, shared, Product::none);
    largest = std::max(largest, std::abs(expected));
    // Rates of the swing, 2e-5 rad/s, would enter squared; settling leaves e^(−4000 s/53 s).
    ASSERT_NEAR(values[index(Signal::gradient_xy)], expected, 1e-6 * 1e-7) << i;
  }
  EXPECT_GT(largest, 1e-7);  // α₀ω² = 1.4e-7 s⁻² at the loop's gain of about one.
}

}  // namespace
}  // namespace proofmass
