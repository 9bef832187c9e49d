#include "core/microscope/campaign/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <type_traits>
#include <vector>

#include "core/error.hpp"
#include "core/microscope/campaign/loop_margins.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

Scenario::Scenario() : sessions(hardy2013_sessions()) {
  std::ranges::transform(microscope_results().quantities, objectives.begin(), &Quantity::objective);
  std::ranges::transform(test_quantities(), test_objectives.begin(), &Quantity::objective);
}

namespace {

template <typename Value>
void check_value(const FieldInfo& field, const Value& value) {
  if constexpr (std::is_enum_v<Value>) {
    const auto names = names_of(value);
    const auto number = static_cast<std::size_t>(value);
    if (number >= 1 && number <= names.size()) return;
    throw ConfigError(field.path, fmt::format("{}", number),
                      fmt::format("must be in [1, {}]", names.size()));
  } else {
    check_field(field, static_cast<double>(value));
  }
}

// At a twentieth of the sample rate the sample of delay costs a loop 18° of phase and the hold
// another 9°; faster loops lose their margins.
void check_loop(std::string_view loop, double bandwidth_hz, double integral_hz,
                double sample_period_s) {
  const double bandwidth_hz_max = 0.05 / sample_period_s;
  if (bandwidth_hz > bandwidth_hz_max) {
    throw ConfigError(
        fmt::format("{}.bandwidth_hz", loop), fmt::format("{}", bandwidth_hz),
        fmt::format("must be <= {}, a twentieth of the sample rate", bandwidth_hz_max));
  }
  if (integral_hz >= bandwidth_hz) {
    throw ConfigError(fmt::format("{}.integral_hz", loop), fmt::format("{}", integral_hz),
                      fmt::format("must be < {}.bandwidth_hz, {}", loop, bandwidth_hz));
  }
}

// Within these bounds shape_noise() finds a filter of finite numbers. Beyond them the squares and
// fourth powers that it is made of leave the range of a double, and every run would diverge.
void check_sensor_noise(std::string_view axis, std::string_view unit, const SensorNoise& noise) {
  const auto refuse = [axis](std::string_view key, std::string_view key_unit, double value,
                             std::string_view rule) {
    throw ConfigError(fmt::format("noise.{}.{}{}", axis, key, key_unit), fmt::format("{}", value),
                      std::string(rule));
  };
  if (noise.white_asd < 1e-100 || noise.white_asd > 1e100) {
    refuse("white_asd", unit, noise.white_asd, "must be in [1e-100, 1e+100]");
  }
  const double ratio = noise.rise_asd / noise.white_asd;
  if (noise.rise_asd != 0.0 && (ratio < 1e-12 || ratio > 1e12)) {
    refuse(
        "rise_asd", unit, noise.rise_asd,
        fmt::format("must be 0 or in [1e-12, 1e+12] times the white level, {}", noise.white_asd));
  }
  if (noise.rise_limit_hz != 0.0 && noise.rise_limit_hz < 1e-6) {
    refuse("rise_limit_hz", "", noise.rise_limit_hz, "must be 0 or in [1e-06, 0.6]");
  }
}

// Up to this corner shape_noise() is known to follow its spectrum.
void check_wire(const NoiseConfig& noise) {
  constexpr double corner_max_hz = 50.0;
  for (std::size_t k = 0; k < noise.wire.factor.size(); ++k) {
    const double corner_hz = linear_x_of(noise, k).pink_corner_hz;
    if (corner_hz <= corner_max_hz) continue;
    throw ConfigError("noise.wire.damping_n_m", fmt::format("{}", noise.wire.damping_n_m),
                      fmt::format("must leave the 1/f noise of sensor {} along x below the white "
                                  "level from {} Hz on, not {:.3g} Hz",
                                  k + 1, corner_max_hz, corner_hz));
  }
}

void check_stiffness(const Scenario& scenario) {
  const std::array<double, 2>& stiffness = scenario.sensor.radial_stiffness_s2;
  const std::size_t k = stiffness[0] == 0.0 ? 1 : 0;
  if (stiffness[k] == 0.0) return;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    if (mass_excitations(scenario.sessions[i])[1] == nullptr) continue;
    throw ConfigError(fmt::format("sensor.sensor_{}_radial_stiffness_s2", k + 1),
                      fmt::format("{}", stiffness[k]),
                      fmt::format("must be 0 where two excitations of a session, session[{}], "
                                  "move test masses",
                                  i));
  }
}

void check_transient(const Scenario& scenario) {
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const double duration_s = scenario.sessions[i].num_orbits * scenario.orbit.period_s;
    if (scenario.estimation.transient_s <= duration_s / 2) continue;
    throw ConfigError("estimation.transient_s", fmt::format("{}", scenario.estimation.transient_s),
                      fmt::format("must leave half of session[{}] with orbits = {}, {} s", i,
                                  scenario.sessions[i].num_orbits, duration_s));
  }
}

void check_band(const Scenario& scenario) {
  const double nyquist_hz = 0.5 / scenario.simulation.sample_period_s;
  const double ratio = scenario.estimation.band_ratio;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const Session& session = scenario.sessions[i];
    for (const LineMultiple& line : session.fit_lines) {
      const double frequency_hz = line_frequency_hz(session, line, scenario.orbit.period_s);
      if (frequency_hz * ratio < nyquist_hz) continue;
      throw ConfigError("estimation.band_ratio", fmt::format("{}", ratio),
                        fmt::format("the band about line {} of session[{}], {:.6g} Hz, must end "
                                    "below the Nyquist frequency, {} Hz",
                                    text_of(line), i, frequency_hz, nyquist_hz));
    }
  }
}

// The lines that a method derives from the excitations: the session's own are checked with it.
void check_wanted_lines(const Scenario& scenario) {
  const auto needs = estimation_method(scenario.estimation.method).needs;
  const double nyquist_hz = 0.5 / scenario.simulation.sample_period_s;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const Session& session = scenario.sessions[i];
    const double resolution_hz = 0.99 / (session.num_orbits * scenario.orbit.period_s);
    std::vector<double> lines_hz{0.0, nyquist_hz};
    for (const WantedLine& wanted : needs(session).lines) {
      const double line_hz = line_frequency_hz(session, wanted.line, scenario.orbit.period_s);
      for (const double other_hz : lines_hz) {
        if (line_hz < nyquist_hz && std::abs(line_hz - other_hz) >= resolution_hz) continue;
        const std::string line = fmt::format("a line at {:.6g} Hz", line_hz);
        const std::string other = fmt::format("a line at {:.6g} Hz", other_hz);
        const std::string named = line == other ? "another one there" : other;
        throw ConfigError(fmt::format("session[{}].excitations", i), line,
                          fmt::format("the estimation must tell it from {} with orbits = {}, and "
                                      "from the Nyquist frequency, {} Hz",
                                      named, session.num_orbits, nyquist_hz));
      }
      lines_hz.push_back(line_hz);
    }
  }
}

// A test that turns with the Earth's direction sees a constant, which a bias is, too.
void check_test(const Scenario& scenario) {
  const double rate_rad_s = scenario.budget.test_spin_rate_rad_s;
  const double turns = rate_rad_s * scenario.orbit.period_s / (2.0 * std::numbers::pi);
  if (std::abs(1.0 + turns) >= 0.1) return;
  throw ConfigError("budget.test_spin_rate_rad_s", fmt::format("{}", rate_rad_s),
                    "must leave f_EP = |f_orb + f_spin| a tenth of f_orb or more");
}

// Up to there the nominal loop stays a third or more away from −1, whatever its corners;
// check_stability() judges others.
void check_resonator(const Scenario& scenario) {
  const DragFreeConfig& config = scenario.drag_free;
  const auto num_others =
      std::ranges::count(scenario.controllers, ControlLoop::drag_free, &ControllerConfig::loop);
  if (config.resonator_damping == 0.0 || num_others == 3) return;
  for (const Session& session : scenario.sessions) {
    if (!is_test(session)) continue;
    const double frequency_hz = test_frequency_hz(session, scenario.orbit.period_s);
    if (frequency_hz <= 0.5 * config.bandwidth_hz) continue;
    throw ConfigError("drag_free.resonator_damping", fmt::format("{}", config.resonator_damping),
                      fmt::format("must be 0 where f_EP of a session, here {:.4g} Hz of {}, is "
                                  "above half of drag_free.bandwidth_hz",
                                  frequency_hz, session.name));
  }
}

void check_controllers(const Scenario& scenario) {
  const std::vector<ControllerConfig>& controllers = scenario.controllers;
  for (std::size_t i = 0; i < controllers.size(); ++i) {
    const std::string path = fmt::format("controller[{}]", i);
    controllers[i].validate(path, scenario.simulation.sample_period_s);
    for (std::size_t k = 0; k < i; ++k) {
      if (controllers[k].loop != controllers[i].loop ||
          controllers[k].axis != controllers[i].axis) {
        continue;
      }
      throw ConfigError(path + ".axis", fmt::format("\"{}\"", name_of(controllers[i].axis)),
                        fmt::format("that axis of the loop has one, controller[{}]", k));
    }
  }
}

// The paper's loops are judged by check_loop().
void check_stability(const Scenario& scenario) {
  if (scenario.has_plain_loops()) return;
  for (const AxisMargins& of : loop_margins(scenario, make_instrument({}))) {
    const bool is_open = of.margins.phase_rad == std::numbers::pi;
    if (of.margins.gain > 0.0 && !is_open) continue;
    const RealismConfig realism = scenario.realism.value_or(RealismConfig{});
    std::string path = "realism.actuation_lag_s";
    double value = realism.actuation_lag_s;
    if (value == 0.0 && realism.star_tracker_latency_samples == 0) {
      path = "realism.inertia_xx_kg_m2";
      value = realism.inertia_kg_m2[0];
    } else if (value == 0.0) {
      path = "realism.star_tracker_latency_samples";
      value = static_cast<double>(realism.star_tracker_latency_samples);
    }
    std::string with;
    if (!of.resonator_of.empty()) {
      path = "drag_free.resonator_damping";
      value = scenario.drag_free.resonator_damping;
      with = fmt::format(" with the resonator of session {}", of.resonator_of);
    }
    for (std::size_t i = 0; i < scenario.controllers.size(); ++i) {
      const ControllerConfig& controller = scenario.controllers[i];
      if (controller.loop != of.loop || controller.axis != of.axis) continue;
      path = fmt::format("controller[{}].gain", i);
      value = controller.gain;
    }
    throw ConfigError(path, fmt::format("{}", value),
                      fmt::format("{} the {} loop of axis {}{}{}, even with a perfect instrument",
                                  is_open ? "does not close" : "makes", name_of(of.loop),
                                  name_of(of.axis), with, is_open ? "" : " unstable"));
  }
}

}  // namespace

void Scenario::validate() const {
  for_each_field(*this,
                 [](const FieldInfo& field, const auto& value) { check_value(field, value); });
  check_sensor_noise("linear_x", "_m_s2", noise.linear_x);
  check_sensor_noise("linear_yz", "_m_s2", noise.linear_yz);
  check_sensor_noise("angular", "_rad_s2", noise.angular);
  check_wire(noise);
  check_stiffness(*this);
  check_loop("drag_free", drag_free.bandwidth_hz, drag_free.integral_hz,
             simulation.sample_period_s);
  check_loop("attitude", attitude.bandwidth_hz, attitude.integral_hz, simulation.sample_period_s);
  validate_sessions(sessions, orbit.period_s, simulation.sample_period_s);
  estimation_method(estimation.method).check(sessions);
  check_test(*this);
  check_resonator(*this);
  if (realism) realism->validate();
  check_controllers(*this);
  check_stability(*this);
  gaps.validate(simulation.sample_period_s);
  check_transient(*this);
  check_band(*this);
  check_wanted_lines(*this);
}

}  // namespace proofmass
