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

}  // namespace
}  // namespace proofmass
