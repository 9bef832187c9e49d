#include "core/microscope/simulation/recorded_signals.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/microscope/simulation/line_fit.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass {
namespace {

using Sample = ObservedSample;
using Vector = Vector3<double>;

/// A row of the tables below: one signal, or three for the axes of a vector.
struct SignalRow {
  std::string_view name;  ///< Of a vector what comes before the letter of the axis.
  std::string_view unit;
  std::string_view frame;
  std::string_view meaning;
  double (*number)(const Sample&) = nullptr;
  Vector (*vector)(const Sample&) = nullptr;  ///< If `number` is null.
};

struct GroupRows {
  std::string_view name;
  std::string_view meaning;
  std::span<const SignalRow> rows;
};

constexpr std::string_view m_s2 = "m/s²", rad = "rad", rad_s = "rad/s", rad_s2 = "rad/s²";

constexpr SignalRow vector_row(std::string_view name, std::string_view unit, std::string_view frame,
                               std::string_view meaning, Vector (*vector)(const Sample&)) {
  return {name, unit, frame, meaning, nullptr, vector};
}

template <Signal signal>
double ground(const Sample& sample) {
  return sample.signals[index(signal)];
}

/// Γ_App,k + p_k of sensor k − 1: Observation keeps only the X component.
template <std::size_t k>
Vector kinematic(const Sample& sample) {
  const auto motion = sample.loop.motion(sample.constants, sample.shared, sample.noise);
  return kinematic_acceleration(sample.constants.sensors[k], motion, sample.shared.mass_motion,
                                sample.shared.second_motion) +
         violation_acceleration(k, sample.violation.eotvos_parameter, sample.violation.gravity_m_s2,
                                motion.radial_S);
}

constexpr std::array measured_rows{
    vector_row("mass_1_K_", m_s2, "K1", "Γ_mes,1 of the inner mass",
               [](const Sample& s) { return s.observation.measured_K[0]; }),
    vector_row("mass_2_K_", m_s2, "K2", "Γ_mes,2 of the outer mass",
               [](const Sample& s) { return s.observation.measured_K[1]; }),
};

// Components of two frames are added here, as the ground does: these numbers are of no frame.
constexpr std::array modes_rows{
    SignalRow{"differential_x", m_s2, "", "Γ_mes,dx = ½(Γ_mes,1x − Γ_mes,2x)",
              ground<Signal::differential_x>},
    SignalRow{"common_x", m_s2, "", "Γ_mes,cx = ½(Γ_mes,1x + Γ_mes,2x)", ground<Signal::common_x>},
    SignalRow{"common_y", m_s2, "", "Γ_mes,cy = ½(Γ_mes,1y + Γ_mes,2y)", ground<Signal::common_y>},
    SignalRow{"common_z", m_s2, "", "Γ_mes,cz = ½(Γ_mes,1z + Γ_mes,2z)", ground<Signal::common_z>},
};

constexpr std::array applied_rows{
    vector_row("mass_1_S_", m_s2, "S", "Γ_App,1 + p_1: applied acceleration less the parasitic one",
               kinematic<0>),
    vector_row("mass_2_S_", m_s2, "S", "Γ_App,2 + p_2: applied acceleration less the parasitic one",
               kinematic<1>),
};

constexpr std::array gradient_rows{
    SignalRow{"gravity", "1/s²", "", "μ/r³", [](const Sample& s) { return s.shared.gradient_s2; }},
    vector_row("radial_R_", "1", "R", "û: unit vector from the Earth's centre to the satellite",
               [](const Sample& s) { return s.shared.radial_R; }),
    vector_row("estimated_S_x", "1/s²", "S", "row X of [T] − [In] from the estimated attitude",
               [](const Sample& s) {
                 return Vector{ground<Signal::gradient_xx>(s), ground<Signal::gradient_xy>(s),
                               ground<Signal::gradient_xz>(s)};
               }),
    vector_row("estimated_S_y", "1/s²", "S", "row Y of [T] − [In] from the estimated attitude",
               [](const Sample& s) {
                 return Vector{ground<Signal::gradient_yx>(s), ground<Signal::gradient_yy>(s),
                               ground<Signal::gradient_yz>(s)};
               }),
    vector_row("estimated_S_z", "1/s²", "S", "row Z of [T] − [In] from the estimated attitude",
               [](const Sample& s) {
                 return Vector{ground<Signal::gradient_zx>(s), ground<Signal::gradient_zy>(s),
                               ground<Signal::gradient_zz>(s)};
               }),
};

constexpr std::array thrust_rows{
    vector_row("acceleration_S_", m_s2, "S", "Γ_propu = −[M_DF] Γ_DF + Γ_n,DF",
               [](const Sample& s) { return s.loop.thrust_S(s.constants, s.noise); }),
    vector_row(
        "command_S_", m_s2, "S",
        "Γ_DF of the sample before as thrusters deliver it now: the acceleration to be cancelled",
        [](const Sample& s) { return s.loop.thrust_command_S; }),
};

constexpr std::array attitude_rows{
    vector_row("angle_RS_S_", rad, "S", "true angles from the reference R to the satellite S",
               [](const Sample& s) { return s.loop.angle_RS_S(s.shared); }),
    vector_row("omega_IS_S_", rad_s, "S", "Ω: true angular velocity against I",
               [](const Sample& s) { return s.loop.omega_IS_S; }),
    vector_row("omega_dot_IS_S_", rad_s2, "S", "true angular acceleration against I",
               [](const Sample& s) {
                 return s.loop.motion(s.constants, s.shared, s.noise).omega_dot_IS_S;
               }),
    vector_row("estimated_angle_RS_S_", rad, "S",
               "angles as estimated on board, with the commanded ones in them",
               [](const Sample& s) { return s.observation.angle_RS_S; }),
    vector_row("estimated_omega_RS_S_", rad_s, "S",
               "angular velocity against R as estimated on board, with the commanded one in it",
               [](const Sample& s) { return s.observation.omega_RS_S; }),
    vector_row("measured_omega_dot_IS_S_", rad_s2, "S", "angular acceleration as measured",
               [](const Sample& s) { return s.observation.measured_omega_dot_IS_S; }),
    vector_row("torque_command_S_", rad_s2, "S",
               "angular acceleration that the attitude loop commands, which acts now",
               [](const Sample& s) { return s.loop.torque_command_S; }),
};

constexpr std::array star_tracker_rows{
    vector_row("angle_RS_S_", rad, "S", "fused angles as reported, with the commanded ones added",
               [](const Sample& s) { return s.observation.star_tracker_RS_S; }),
};

constexpr std::array environment_rows{
    vector_row("linear_S_", m_s2, "S", "Γ_ext: drag and other external accelerations",
               [](const Sample& s) { return s.shared.external_S.linear_m_s2; }),
    vector_row("angular_S_", rad_s2, "S", "angular acceleration by external torques",
               [](const Sample& s) { return s.shared.external_S.angular_rad_s2; }),
};

constexpr std::array excitation_rows{
    vector_row("drag_free_S_", m_s2, "S", "C_cal, added to the input of the drag-free loop",
               [](const Sample& s) { return s.shared.drag_free_command_S_m_s2; }),
    vector_row("attitude_S_", rad, "S", "angles added to the output of the star tracker",
               [](const Sample& s) { return s.shared.attitude_command_S_rad; }),
    SignalRow{"mass_position", "m", "", "motion of the test masses, Δ_TM sin(2π f t)",
              [](const Sample& s) { return s.shared.mass_motion.position_m; }},
    SignalRow{"mass_velocity", "m/s", "", "its first derivative",
              [](const Sample& s) { return s.shared.mass_motion.velocity_m_s; }},
    SignalRow{"mass_acceleration", m_s2, "", "its second derivative",
              [](const Sample& s) { return s.shared.mass_motion.acceleration_m_s2; }},
    SignalRow{"second_mass_position", "m", "", "a second motion of the test masses",
              [](const Sample& s) { return s.shared.second_motion.position_m; }},
};

constexpr std::array ground_rows{
    SignalRow{"lost", "1", "", "1 in a block of 16 samples of which [gaps] takes some",
              [](const Sample& s) { return s.is_lost ? 1.0 : 0.0; }},
};

std::span<const GroupRows> groups() {
  static constexpr std::array<GroupRows, 10> all{{
      {"measured", "what the two sensors report", measured_rows},
      {"modes", "half difference and half sum of what the sensors report", modes_rows},
      {"applied", "accelerations that act on the test masses", applied_rows},
      {"gradient", "gravity gradient and the Earth's direction", gradient_rows},
      {"thrust", "acceleration by the thrusters, and its command", thrust_rows},
      {"attitude", "true, estimated and commanded rotation of the satellite", attitude_rows},
      {"star_tracker", "what the star tracker reports", star_tracker_rows},
      {"environment", "accelerations from outside", environment_rows},
      {"excitation", "what the session shakes", excitation_rows},
      {"ground", "what reaches the ground", ground_rows},
  }};
  return all;
}

void append_signals(const SignalRow& row, std::vector<RecordedSignal>& signals) {
  const auto append = [&](std::string name, const std::string& meaning) {
    signals.push_back({.name = std::move(name),
                       .unit = std::string(row.unit),
                       .frame = std::string(row.frame),
                       .meaning = meaning});
  };
  if (row.number != nullptr) {
    append(std::string(row.name), std::string(row.meaning));
    return;
  }
  for (const char axis : {'x', 'y', 'z'}) {
    append(std::string(row.name) + axis, std::string(row.meaning) + ", component " + axis);
  }
}

/// Index of a signal among all values of a sample.
/// @pre There is one.
std::size_t value_index(const Recording& recording, std::string_view group_name,
                        std::string_view signal_name) {
  std::size_t index = 0;
  for (const SignalGroup& group : recording.groups) {
    for (const RecordedSignal& signal : group.signals) {
      if (group.name == group_name && signal.name == signal_name) return index;
      ++index;
    }
  }
  return index;
}

/// What expected_spectra() takes for noise.
std::string noise_meaning_of(const NoiseConfig& noise) {
  if (noise.scale == 0.0) return "This campaign has no noise.";
  std::string text = "The noise model is half the difference of the noise of both sensors.";
  if (noise.thrust_asd_m_s2 > 0.0) {
    text +=
        " What the drag-free loop leaves of the thrust's noise comes on top, most around 10 mHz, "
        "the more the less both sensors are alike.";
  }
  return text + " So does that of the attitude, times the offcentring.";
}

/// The lines of the session. A test reads g at its frequency, and the gradient at twice that.
LineFit spectrum_fit(const Scenario& scenario, const Session& session) {
  LineFit fit = line_fit(scenario, session);
  if (!is_test(session)) return fit;
  const double frequency_hz = test_frequency_hz(session, scenario.orbit.period_s);
  fit.fit_hz = {frequency_hz};
  fit.known_hz = {2.0 * frequency_hz};
  fit.filter = no_filter;
  return fit;
}

/// Half the difference of two sensors whose noise is independent has a quarter of the sum of both
/// PSDs. What the loops leave of thrust and attitude reaches Γ_mes,dx through factors of a percent
/// and is left out.
std::vector<ExpectedSpectrum> expected_spectra(const Scenario& scenario, const NoiseModel& noise,
                                               const Recording& recording) {
  const std::size_t differential_x = value_index(recording, "modes", "differential_x");
  const double period_s = scenario.simulation.sample_period_s;
  const auto noise_psd = [shapes = noise.linear_x, period_s](double frequency_hz) {
    return 0.25 * (shapes[0].psd(frequency_hz, period_s) + shapes[1].psd(frequency_hz, period_s));
  };
  const std::string noise_meaning = noise_meaning_of(scenario.noise);
  std::vector<ExpectedSpectrum> spectra;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const LineFit fit = spectrum_fit(scenario, scenario.sessions[i]);
    ExpectedSpectrum& spectrum = spectra.emplace_back();
    spectrum.session = i;
    spectrum.value = differential_x;
    spectrum.fits.push_back(fit);
    for (LineFit& known : known_line_fits(fit)) {
      // The band-pass may leave a hundredth of a line that is far from those of the estimate, less
      // than what the filter's transient leaves of others.
      known.filter = no_filter;
      known.num_dropped = 0;
      spectrum.fits.push_back(std::move(known));
    }
    spectrum.noise_psd = noise_psd;
    spectrum.noise_meaning = noise_meaning;
  }
  return spectra;
}

}  // namespace

Recording recording_of(const Scenario& scenario, const NoiseModel& noise) {
  Recording recording;
  recording.frames = {
      {"I", "inertial: X towards perigee, Y normal to the orbital plane, Z in the plane"},
      {"R", "reference of the attitude loop: I, turned about Y at the session's spin rate"},
      {"S", "satellite in its true attitude; X is the sensitive axis"},
      {"K1", "sensor of the inner mass, misaligned against S by mrad"},
      {"K2", "sensor of the outer mass, misaligned against S by mrad"}};
  for (const GroupRows& rows : groups()) {
    SignalGroup& group = recording.groups.emplace_back();
    group.name = rows.name;
    group.meaning = rows.meaning;
    for (const SignalRow& row : rows.rows) append_signals(row, group.signals);
  }
  for (const Session& session : scenario.sessions) {
    recording.sessions.push_back(
        {.name = session.name,
         .sample_period_s = scenario.simulation.sample_period_s,
         .num_samples = static_cast<std::uint64_t>(num_record_samples(scenario, session))});
  }
  recording.spectra = expected_spectra(scenario, noise, recording);
  return recording;
}

void append_recorded_values(const ObservedSample& sample, std::vector<double>& values) {
  for (const GroupRows& group : groups()) {
    for (const SignalRow& row : group.rows) {
      if (row.number != nullptr) {
        values.push_back(row.number(sample));
        continue;
      }
      const Vector vector = row.vector(sample);
      for (std::size_t axis = 0; axis < 3; ++axis) values.push_back(vector[axis]);
    }
  }
}

}  // namespace proofmass
