#include "core/microscope/campaign/loop_margins.hpp"

#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/microscope/simulation/realism.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

Scenario silent_scenario() {
  Scenario scenario;
  scenario.noise.scale = 0.0;
  scenario.environment.scale = 0.0;
  scenario.sessions.resize(1);
  return scenario;
}

/// Proportional and derivative with a roll-off, and a lag in what acts.
Scenario scenario_with_attitude_controller(double gain) {
  Scenario scenario = silent_scenario();
  ControllerConfig& controller = scenario.controllers.emplace_back();
  controller.loop = ControlLoop::attitude;
  controller.axis = Axis::z;
  controller.gain = gain;
  controller.zeros_rad_s = {-0.08};
  controller.poles_rad_s = {-2.0};
  controller.delay_samples = 1;
  scenario.realism.emplace().actuation_lag_s = 0.5;
  scenario.realism->star_tracker_latency_samples = 8;
  return scenario;
}

/// By how much the satellite's angle about Z grew over the second half of 2000 s, from a small
/// turn at the start, as it is simulated.
double growth(const Scenario& scenario) {
  const Instrument instrument = make_instrument({});
  const LoopConstants<double> constants =
      make_loop_constants(instrument, scenario, scenario.sessions[0]);
  const double period_s = scenario.simulation.sample_period_s;
  const DragFreeGains drag_free = drag_free_gains(scenario.drag_free, period_s);
  const AttitudeGains attitude = attitude_gains(scenario.attitude, period_s);
  Realism realism(scenario, instrument, constants, 0, 0);
  Loop<double> loop;
  loop.omega_IS_S.z = 1e-9;
  const SharedSample shared;
  double before = 0.0, after = 0.0;
  constexpr int num_samples = 8000;
  for (int k = 0; k < num_samples; ++k) {
    (void)loop.advance(constants, drag_free, attitude, shared, SampleNoise<double>{}, Watch::yes,
                       NoViolation{}, AsMeasured{}, realism);
    double& largest = k < num_samples / 2 ? before : after;
    if (k > num_samples / 4) largest = std::max(largest, std::abs(loop.omega_IS_S.z));
  }
  return after / before;
}

Margins margins_about_z(const Scenario& scenario) {
  for (const AxisMargins& of : loop_margins(scenario, make_instrument({}))) {
    if (of.loop == ControlLoop::attitude && of.axis == Axis::z) return of.margins;
  }
  return {};
}

// The gain at which the simulated loop begins to swing is the one that the margin tells.
TEST(LoopMargins, TellWhereTheSimulatedAttitudeLoopBeginsToSwing) {
  const double gain = 0.3;
  const Margins margins = margins_about_z(scenario_with_attitude_controller(gain));
  ASSERT_GT(margins.gain, 1.1);
  EXPECT_LT(growth(scenario_with_attitude_controller(gain)), 0.1);
  EXPECT_LT(growth(scenario_with_attitude_controller(0.99 * gain * margins.gain)), 0.5);
  EXPECT_GT(growth(scenario_with_attitude_controller(1.01 * gain * margins.gain)), 2.0);
}

// Scale factors and thrusters of the instrument that was drawn multiply the drag-free loop.
TEST(LoopMargins, FollowTheInstrument) {
  const Scenario scenario = silent_scenario();
  Instrument instrument = make_instrument({});
  const auto gain_about_y = [&] {
    for (const AxisMargins& of : loop_margins(scenario, instrument)) {
      if (of.loop == ControlLoop::drag_free && of.axis == Axis::y) return of.margins.gain;
    }
    return 0.0;
  };
  const double perfect = gain_about_y();
  instrument.thrust_matrix(1, 1) *= 1.1;
  instrument.sensors[0].scale_factor.y() *= 1.04;
  EXPECT_NEAR(perfect / gain_about_y(), 1.1 * 1.02, 1e-9);
}

// Two axes that a product of inertia couples have the modes x ± y, whose gains are 1/(1 ± ρ) times
// that of one axis, ρ = J_xy/J_xx.
TEST(LoopMargins, AreThoseOfCoupledModes) {
  Scenario scenario = silent_scenario();
  const double alone = margins_about_z(scenario).gain;
  scenario.realism.emplace().inertia_kg_m2 = {90.0, 90.0, 100.0};
  EXPECT_NEAR(margins_about_z(scenario).gain / alone, 1.0, 1e-9);
  scenario.realism->inertia_products_kg_m2 = {45.0, 0.0, 0.0};
  EXPECT_NEAR(margins_about_z(scenario).gain / alone, 0.5, 1e-9);
}

/// A test at V3, in a loop about X with a resonator and a controller of its own.
Scenario scenario_with_resonator(double gain, std::vector<std::complex<double>> zeros_rad_s,
                                 std::vector<std::complex<double>> poles_rad_s) {
  Scenario scenario;
  Session& test = scenario.sessions.emplace_back();
  test.name = "v3";
  test.target = SessionTarget::ep_test;
  test.spin_rate_rad_s = 35.0 * std::numbers::pi / scenario.orbit.period_s;  // f_EP = 18.5 f_orb.
  scenario.drag_free.resonator_damping = 0.5;
  scenario.controllers.push_back({.loop = ControlLoop::drag_free,
                                  .axis = Axis::x,
                                  .gain = gain,
                                  .zeros_rad_s = std::move(zeros_rad_s),
                                  .poles_rad_s = std::move(poles_rad_s)});
  return scenario;
}

/// By how much the command along X that a push causes grew over the second half of 5000 s.
double drag_free_growth(const Scenario& scenario) {
  const double period_s = scenario.simulation.sample_period_s;
  const ResonatorGains gains = resonator_gains(scenario.drag_free.resonator_damping,
                                               18.5 / scenario.orbit.period_s, period_s);
  Resonator<double> resonator;
  SampledController controller(scenario.controllers[0], period_s);
  double command = 0.0, before = 0.0, after = 0.0;
  constexpr int num_samples = 20'000;
  for (int k = 0; k < num_samples; ++k) {
    const double measured = (k == 0 ? 1.0 : 0.0) - command;
    command = controller.advance(resonator.advance(gains, {measured, 0.0, 0.0}).x);
    double& largest = k < num_samples / 2 ? before : after;
    if (k > num_samples / 4) largest = std::max(largest, std::abs(command));
  }
  return after / before;
}

// A controller of 0.8 mHz has a phase margin of 11.59° with a resonator at 3.1 mHz: L(z) of its
// definition, where it passes the unit circle.
TEST(LoopMargins, AreThoseOfTheLoopWithItsResonator) {
  const Scenario slow = scenario_with_resonator(0.005, {-0.0005}, {0.0, 0.0});
  EXPECT_NO_THROW(slow.validate());
  const double phase_rad = least(loop_margins(slow, make_instrument({}))).phase_rad;
  EXPECT_NEAR(phase_rad * 180.0 / std::numbers::pi, 11.59, 0.01);
}

// With two corners the loop swings if its gain is divided by that margin.
TEST(LoopMargins, TellWhereTheSimulatedLoopWithAResonatorBeginsToSwing) {
  Scenario scenario = scenario_with_resonator(3e-4, {-0.003}, {0.0, 0.0, -0.1, -0.1});
  const double margin = least(loop_margins(scenario, make_instrument({}))).gain;
  const double gain = scenario.controllers[0].gain;
  for (const double beyond : {0.98, 1.02}) {
    scenario.controllers[0].gain = gain / (beyond * margin);
    EXPECT_EQ(drag_free_growth(scenario) > 1.0, beyond > 1.0) << margin;
    EXPECT_EQ(least(loop_margins(scenario, make_instrument({}))).gain == 0.0, beyond > 1.0);
  }
}

TEST(LoopMargins, RefuseALoopThatItsResonatorMakesUnstable) {
  const double corner = -0.003 * std::numbers::pi;
  Scenario scenario =
      scenario_with_resonator(0.006 * corner * corner, {-6e-4}, {0.0, 0.0, corner, corner});
  EXPECT_GT(drag_free_growth(scenario), 2.0);
  try {
    scenario.validate();
    ADD_FAILURE() << "it is accepted";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.field(), "controller[0].gain");
    EXPECT_THAT(error.what(), ::testing::HasSubstr("with the resonator of session v3 unstable"));
  }
  scenario.drag_free.resonator_damping = 0.0;
  EXPECT_NO_THROW(scenario.validate());
}

TEST(LoopMargins, RefuseAnUnstableLoop) {
  Scenario scenario = scenario_with_attitude_controller(0.3);
  scenario.sessions = Scenario().sessions;
  EXPECT_NO_THROW(scenario.validate());
  scenario.controllers[0].gain = 30.0;
  EXPECT_THROW(scenario.validate(), ConfigError);
  scenario.controllers.clear();
  scenario.realism->actuation_lag_s = 60.0;  // The paper's loops do not hold with it.
  EXPECT_THROW(scenario.validate(), ConfigError);
}

// s³ + 2ζω s² + ω² s + ω² ω_i of the nominal attitude loop; (s + ω_i)² of a drag-free one with
// ω_c = 4 ω_i; a controller of gain g and pole p, whose 1 + L has its zero at p − g.
TEST(SlowestDecay, IsThatOfTheClosedLoops) {
  Scenario scenario;
  const double omega = 2.0 * std::numbers::pi * scenario.attitude.bandwidth_hz;
  const double integral = 2.0 * std::numbers::pi * scenario.attitude.integral_hz;
  const double s = -1.0 / slowest_decay_s(scenario);
  EXPECT_NEAR(((s + 2.0 * scenario.attitude.damping * omega) * s + omega * omega) * s,
              -omega * omega * integral, 1e-12 * omega * omega * integral);
  EXPECT_NEAR(s, -integral, 0.2 * integral);
  scenario.drag_free.bandwidth_hz = 1e-3;
  scenario.drag_free.integral_hz = 2.5e-4;
  EXPECT_NEAR(slowest_decay_s(scenario) * 2.0 * std::numbers::pi * 5e-4, 1.0, 1e-6);
  scenario.drag_free.integral_hz = 0.0;  // What is not there decays not slowly.
  EXPECT_NEAR(slowest_decay_s(scenario) * 2.0 * std::numbers::pi * 1e-3, 1.0, 1e-9);
  scenario.controllers.push_back({.loop = ControlLoop::drag_free,
                                  .axis = Axis::z,
                                  .gain = 2e-4,
                                  .zeros_rad_s = {},
                                  .poles_rad_s = {-3e-4}});
  EXPECT_NEAR(slowest_decay_s(scenario), 2000.0, 1e-6);
  scenario.realism.emplace().actuation_lag_s = 100.0;  // 100 s² + (1 + 0.03) s + 5e-4 = 0.
  EXPECT_NEAR(slowest_decay_s(scenario), 2.0 / (0.0103 - std::sqrt(0.0103 * 0.0103 - 2e-5)), 1e-6);
}

}  // namespace
}  // namespace proofmass
