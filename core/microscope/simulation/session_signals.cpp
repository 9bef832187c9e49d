#include "core/microscope/simulation/session_signals.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/microscope/instrument/stiffness.hpp"

namespace proofmass {

std::int64_t num_record_samples(const Scenario& scenario, const Session& session) {
  const double samples =
      session.num_orbits * scenario.orbit.period_s / scenario.simulation.sample_period_s;
  return static_cast<std::int64_t>(std::floor(samples + 1e-6));
}

namespace {

// Not inlined: in inertial pointing, the common case, advance() is then small enough to be.
__attribute__((noinline)) void turn(const Quaternion<double>& attitude, ExternalAcceleration& at) {
  at = {to_target(attitude, at.linear_m_s2), to_target(attitude, at.angular_rad_s2)};
}

}  // namespace

SessionSignals::SessionSignals(const Scenario& scenario, const Session& session,
                               const KeplerOrbit& orbit, const Environment& environment)
    : orbit_(&orbit),
      environment_(environment),
      // An environment file is of the frame in which the satellite flies.
      turns_environment_(session.spin_rate_rad_s != 0.0 &&
                         scenario.environment.kind == EnvironmentKind::harmonic),
      gains_(attitude_gains(scenario.attitude, scenario.simulation.sample_period_s)),
      sample_period_s_(scenario.simulation.sample_period_s),
      spin_rate_rad_s_(session.spin_rate_rad_s),
      num_settling_(static_cast<std::int64_t>(
          std::floor(scenario.simulation.settling_s / scenario.simulation.sample_period_s))),
      num_record_(num_record_samples(scenario, session)),
      next_(-num_settling_) {
  environment_.begin_session(static_cast<double>(num_record_) * sample_period_s_);
  feels_stiffness_ = feels_stiffness(scenario.sensor, session);
  num_excitations_ = session.excitations.size();
  PROOFMASS_EXPECT(num_excitations_ <= num_excitations_max);
  for (std::size_t i = 0; i < num_excitations_; ++i) {
    excitations_[i] = session.excitations[i];
    if (excitations_[i].kind == ExcitationKind::attitude) commands_attitude_ = true;
  }
}

SessionSignals::Reference SessionSignals::reference_at_start() const {
  return reference_from(reference_phase(static_cast<double>(-num_settling_) * sample_period_s_));
}

SessionSignals::Reference SessionSignals::reference_from(const SineCosine& phase) const {
  return {.attitude_IR = {phase.cosine, {0.0, phase.sine, 0.0}},
          .omega_IR_R = {0.0, spin_rate_rad_s_, 0.0}};
}

SharedSample SessionSignals::next() {
  const double time = time_s(0);
  SharedSample sample;
  SamplePhases phases{orbit_->at(time), reference_phase(time), {}};
  set_excitation_phases(time, phases);
  advance(phases, sample);
  return sample;
}

void SessionSignals::next(std::span<const SamplePhases> phases, std::span<SharedSample> samples) {
  for (std::size_t i = 0; i < phases.size(); ++i) advance(phases[i], samples[i]);
}

void SessionSignals::advance(const SamplePhases& phases, SharedSample& sample) {
  const OrbitPoint& point = phases.orbit;
  const Reference reference = reference_from(phases.reference);
  sample.gradient_s2 = point.gradient_s2;
  sample.radial_I = {point.radial_I_x, 0.0, point.radial_I_z};
  sample.attitude_IR = reference.attitude_IR;
  sample.omega_IR_R = reference.omega_IR_R;
  sample.radial_R = to_target(reference.attitude_IR, sample.radial_I);
  sample.external_S = environment_.at(time_s(0), point);
  if (turns_environment_) [[unlikely]]
    turn(reference.attitude_IR, sample.external_S);
  if (num_excitations_ > 0) excite(phases, sample);
  if (commands_attitude_) {
    commanded_.correct(gains_, sample.attitude_command_S_rad);
    sample.commanded = commanded_;
    commanded_.predict(gains_, {}, sample.omega_IR_R);
  }
  ++next_;
}

void SessionSignals::excite(const SamplePhases& phases, SharedSample& sample) const {
  // A sample may still hold the values of an earlier one. The first excitation of an axis replaces
  // them, a further one is added.
  std::array<bool, 3> is_turned{}, is_pushed{};
  bool is_moved = false;
  const auto put = [](double& value, bool& is_set, double excitation) {
    value = is_set ? value + excitation : excitation;
    is_set = true;
  };
  for (std::size_t i = 0; i < num_excitations_; ++i) {
    const Excitation& excitation = excitations_[i];
    const SineCosine& phase = phases.excitation[i];
    const std::size_t axis = index(excitation.axis);
    const double value = excitation.amplitude * phase.sine;
    switch (excitation.kind) {
      case ExcitationKind::attitude:
        put(sample.attitude_command_S_rad[axis], is_turned[axis], value);
        break;
      case ExcitationKind::drag_free:
        put(sample.drag_free_command_S_m_s2[axis], is_pushed[axis], value);
        break;
      case ExcitationKind::test_mass: {
        const double omega = 2.0 * std::numbers::pi * excitation.frequency_hz;
        (is_moved ? sample.second_motion : sample.mass_motion) = {
            value, omega * excitation.amplitude * phase.cosine, -omega * omega * value};
        is_moved = true;
        if (feels_stiffness_) sample.second_motion = {0.0, 0.0, value};
        break;
      }
    }
  }
}

}  // namespace proofmass
