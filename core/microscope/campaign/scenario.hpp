#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/field.hpp"
#include "core/microscope/campaign/parameter.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {

enum class EnvironmentKind : std::uint8_t { harmonic = 1, file = 2 };
enum class NoisePreset : std::uint8_t { design_2013 = 1, flight_suref = 2 };
/// Position in the list of core/microscope/estimation/methods.cpp, from 1; `hardy2013` is the
/// first.
enum class EstimationMethod : std::uint8_t {};
/// What an estimation round subtracts of what the round before found, see estimate_hardy2013().
enum class Correction : std::uint8_t { first_order = 1, second_order = 2, hardy2013 = 3 };

/// Spelling of an enumerator in campaign files; the list of all of them, in value order from 1.
/// That of the methods stands in core/estimation.
[[nodiscard]] std::span<const std::string_view> names_of(EnvironmentKind);
[[nodiscard]] std::span<const std::string_view> names_of(NoisePreset);
[[nodiscard]] std::span<const std::string_view> names_of(EstimationMethod);
[[nodiscard]] std::span<const std::string_view> names_of(Correction);

struct OrbitConfig {
  double period_s = 5950.0;
  double eccentricity = 5e-3;
};

struct SimulationConfig {
  double sample_period_s = 0.25;
  double settling_s = 4000.0;  ///< Time that the loops run before a session's record begins.
};

/// mean + a₁ cos(n t + φ₁) + a₂ cos(2 n t + φ₂), t from perigee, n the mean motion.
struct HarmonicAxis {
  double mean = 0.0;
  double orbital = 0.0;
  double orbital_phase_rad = 0.0;
  double twice_orbital = 0.0;
  double twice_orbital_phase_rad = 0.0;
};

/// External acceleration of the satellite, in S: linear m/s², angular rad/s².
struct EnvironmentConfig {
  EnvironmentKind kind = EnvironmentKind::harmonic;
  double scale = 1.0;  ///< Multiplies every external acceleration; 0 switches them off.
  HarmonicAxis linear_x, linear_y, linear_z;
  HarmonicAxis angular_x, angular_y, angular_z;

  EnvironmentConfig();  ///< The nominal harmonic environment.
};

struct NoiseConfig {
  NoisePreset preset = NoisePreset::design_2013;
  double scale = 1.0;     ///< Multiplies every noise of the simulation; 0 switches them off.
  SensorNoise linear_x;   ///< Each sensor, sensitive axis, m/s².
  SensorNoise linear_yz;  ///< Each sensor, Y and Z, m/s².
  SensorNoise angular;    ///< Measured angular acceleration, each axis, rad/s².
  double star_tracker_across_asd_rad = 7e-6;       ///< One head, across its boresight, rad/√Hz.
  double star_tracker_boresight_asd_rad = 3.5e-5;  ///< One head, about its boresight, rad/√Hz.
  double thrust_asd_m_s2 = 4.7e-10;                ///< Each axis, (m/s²)/√Hz.
  double torque_asd_rad_s2 = 1e-9;                 ///< Each axis, (rad/s²)/√Hz.

  NoiseConfig();  ///< The preset `design_2013`.
};

/// All of a preset's noise, with scale 1.
[[nodiscard]] NoiseConfig noise_preset(NoisePreset preset);

/// Linear loop L(s) = (ω_c/s)(1 + ω_i/s), one sample of delay.
struct DragFreeConfig {
  double bandwidth_hz = 0.05;  ///< f_c.
  double integral_hz = 0.005;  ///< f_i.
  /// Error of the read-out bias that the loop subtracts, on each axis of S, m/s².
  double bias_compensation_error_x_m_s2 = 0.0;
  double bias_compensation_error_y_m_s2 = 0.0;
  double bias_compensation_error_z_m_s2 = 0.0;
};

/// Proportional-derivative loop of natural frequency f and damping ζ, with a slow integral.
struct AttitudeConfig {
  double bandwidth_hz = 0.02;
  double damping = 0.8;
  double integral_hz = 1e-3;  ///< Corner below which the integral acts.
  double blending_hz = 3e-3;  ///< Crossover from star tracker to angular accelerometer.
};

struct EstimationConfig {
  EstimationMethod method{1};  ///< `hardy2013`.
  Correction correction = Correction::second_order;
  double transient_s = 1000.0;  ///< Filtered record dropped at a session's start.
  double band_ratio = 3.0;      ///< Band-pass from f/ratio to f·ratio.
  double convergence = 0.01;    ///< Stop when no estimate moves by this part of its objective.
  std::int64_t num_rounds_max = 10;
};

struct SensorConfig {
  /// Largest acceleration that a sensor reports on an axis, m/s²; a larger one reads as this.
  double range_m_s2 = 1e-5;
};

/// Limits beyond which a run is `lost`: its estimates are not what the method claims of them. A
/// sensor at the end of its range is lost, too.
struct HealthConfig {
  double attitude_max_rad = 1.4e-3;  ///< The tilt behind the budget's T_xy.
  double residual_max_m_s2 = 1e-10;  ///< K2 of its square: 1e-3 of Δx's objective at the bound.
  double quadratic_noise_max = 1.0;  ///< Then noise is √2 of what the sensors have.
  double square_noise_max = 5e-4;    ///< K2 is then known to 1.6 %, and its estimate still linear.
};

/// A draw outside these bounds is drawn again.
struct AcceptanceConfig {
  double a_d11_max = 1e-2;
  double a_d1j_max_rad = 1.6e-3;  ///< |a_d12| and |a_d13|.
  double a_c1j_max_rad = 2.6e-3;  ///< |a_c12| and |a_c13|.
};

/// Levels and bounds behind the budget tables ([Hardy2013] tab:Budget, tab:Budget_cali).
struct BudgetConfig {
  double t_xy_s2 = 3.0e-11;            ///< T_xy at f_EP, from 1.4 mrad of tilt.
  double residual_m_s2 = 1e-12;        ///< Drag-free residue at f_EP.
  double differential_m_s2 = 1.43e-8;  ///< Γ_app,d at DC.
  double offcentring_max_m = 20e-6;
  double scale_factor_error_max = 1e-2;
  double quadratic_factor_max_s2_m = 14000.0;
};

/// Everything that defines the runs of a campaign apart from seed, number and dispersions.
struct Scenario {
  OrbitConfig orbit;
  SimulationConfig simulation;
  EnvironmentConfig environment;
  NoiseConfig noise;
  DragFreeConfig drag_free;
  AttitudeConfig attitude;
  SensorConfig sensor;
  HealthConfig health;
  EstimationConfig estimation;
  AcceptanceConfig acceptance;
  BudgetConfig budget;
  ParameterArray objectives;  ///< SI; [Hardy2013] tab:perfo-numerical by default.
  std::vector<Session> sessions;

  Scenario();  ///< The nominal scenario.

  /// @throws ConfigError naming the field, its value and the rule.
  void validate() const;
};

/// Calls visit(FieldInfo, value) for every number and choice of the scenario except its sessions,
/// in file order. `Config` is Scenario or const Scenario; the value is a (const) reference to
/// double, std::int64_t or one of the enumerations above.
template <typename Config, typename Visitor>
void for_each_field(Config& scenario, Visitor&& visit);

/// `objective.a_c12_rad`: table and key of a parameter's objective in a campaign file.
[[nodiscard]] std::string_view objective_path(std::size_t parameter);

}  // namespace proofmass

#include "core/microscope/campaign/scenario_fields.hpp"
