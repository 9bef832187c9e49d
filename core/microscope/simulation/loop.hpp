#pragma once

#include <array>
#include <cstdint>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/instrument/sensor_model.hpp"
#include "core/microscope/simulation/sample_noise.hpp"
#include "core/microscope/simulation/session_signals.hpp"

namespace proofmass {

// The closed loop of one satellite: what it measures, what its controllers command, how it moves.
// The letters of the frames are those of core/microscope/README.md; T is the number type.

/// Constants of one drawn satellite during one session; make_loop_constants() makes them.
template <typename T>
struct LoopConstants {
  std::array<SensorModel<T>, 2> sensors;
  std::array<T, 2> drag_free_weight;   ///< Of each sensor's measurement in the loop's input.
  Vector3<T> subtracted_bias_S_m_s2;   ///< Known read-out bias of that input.
  Matrix3<T> thrust_matrix;            ///< [M_DF]: acceleration in S for a command in S.
  Vector3<T> angular_bias_S_rad_s2;    ///< Of the measured angular acceleration.
  Vector3<T> star_tracker_bias_S_rad;  ///< Of the fused angles.
  double sensor_range_m_s2 = 0.0;      ///< One number for all lanes.
};

/// What the instrument and the on-board estimator report at one sample.
template <typename T>
struct Observation {
  std::array<Vector3<T>, 2> measured_K;  ///< Γ_mes,k, each in its sensor's frame, m/s².
  std::array<T, 2> kinematic_S_x;        ///< Γ_App,k + p_k along X, m/s².
  Vector3<T> measured_omega_dot_IS_S;    ///< rad/s².
  Vector3<T> star_tracker_RS_S;          ///< Fused angles with what the session adds to them, rad.
  Vector3<T> angle_RS_S;                 ///< Estimated, with the commanded motion in it, rad.
  Vector3<T> omega_RS_S;                 ///< Likewise, rad/s.
};

/// Whether the largest acceleration and angle are looked at in a sample: in every fourth it costs
/// little, and a limit cycle at half the sample rate has the same size in all of them. From the
/// sample on in which a sensor is found beyond its range, its measurements end there.
enum class Watch : std::uint8_t { no, yes };

/// Both masses fall alike.
struct NoViolation {
  static constexpr bool is_active = false;
};

/// One may fall faster: arguments of violation_acceleration().
template <typename T>
struct Violation {
  static constexpr bool is_active = true;
  T eotvos_parameter{};
  double gravity_m_s2 = 0.0;
};

/// The drag-free controller gets what is measured.
struct AsMeasured {
  template <typename T>
  PROOFMASS_INLINE const Vector3<T>& operator()(const Vector3<T>& input_S) const {
    return input_S;
  }
};

/// Star tracker, thrusters and satellite as the paper has them: Loop::advance() says where each
/// acts.
struct PaperHardware {
  template <typename T>
  PROOFMASS_INLINE void begin_sample(const LoopConstants<T>& /*constants*/) const {}
  template <typename T>
  PROOFMASS_INLINE const Vector3<T>& seen(const Vector3<T>& angle_RS_S) const {
    return angle_RS_S;
  }
  template <typename T>
  PROOFMASS_INLINE const Vector3<T>& measured(const Vector3<T>& omega_dot_IS_S) const {
    return omega_dot_IS_S;
  }
  template <typename T>
  PROOFMASS_INLINE void steer(const Vector3<T>& /*input_S*/, const Vector3<T>& /*angle_RS_S*/,
                              const Vector3<T>& /*thrust_S*/,
                              const Vector3<T>& /*torque_S*/) const {}
  template <typename T>
  PROOFMASS_INLINE void actuate(const LoopConstants<T>& /*constants*/,
                                const Vector3<T>& /*omega_IS_S*/, const Vector3<T>& /*thrust_S*/,
                                const Vector3<T>& /*torque_S*/) const {}
};

/// Satellite, instrument, drag-free and attitude loops, from sample to sample ([Hardy2013]
/// section 5.1).
///
/// Within a sample the order is: the commands of the sample before act; the masses are measured;
/// star tracker and angular accelerometer are blended; both controllers compute the commands that
/// act from the next sample on; the attitude moves on under an angular acceleration that is
/// constant until then.
template <typename T>
struct Loop {
  Quaternion<T> attitude_IS;    ///< True attitude.
  Vector3<T> omega_IS_S;        ///< Ω, rad/s.
  Vector3<T> thrust_command_S;  ///< Γ_DF of the sample before, as it acts now, m/s².
  Vector3<T> torque_command_S;  ///< Angular acceleration, likewise, rad/s².
  DragFreeController<T> drag_free;
  AttitudeEstimator<T> estimator;  ///< With the commanded motion in its angles.
  AttitudeController<T> controller;
  T largest_acceleration{};       ///< |Γ_mes,k| on any axis before the range cuts it off, m/s².
  T largest_angle{};              ///< |θ̂| about any axis, rad.
  bool is_any_saturated = false;  ///< True once a sensor of any lane was beyond its range.

  /// Puts the satellite at rest in its reference attitude.
  PROOFMASS_INLINE void begin(const SessionSignals::Reference& reference) {
    attitude_IS = {T(reference.attitude_IR.scalar), broadcast<T>(reference.attitude_IR.vector)};
    omega_IS_S = broadcast<T>(reference.omega_IR_R);
  }

  /// Forgets what the loops did while they settled.
  PROOFMASS_INLINE void begin_record() {
    largest_acceleration = largest_angle = T(0.0);
    is_any_saturated = false;
  }

  // How the satellite moves at a sample, and what is seen of its attitude. They hold before
  // advance() of that sample.

  /// Γ_propu, m/s²: −[M_DF] Γ_DF + Γ_n,DF.
  PROOFMASS_INLINE Vector3<T> thrust_S(const LoopConstants<T>& constants,
                                       const SampleNoise<T>& noise) const {
    return noise.thrust_S - constants.thrust_matrix * thrust_command_S;
  }

  /// With Γ_sat = Γ_propu + Γ_ext.
  template <typename Shared>
  PROOFMASS_INLINE SatelliteMotion<T> motion(const LoopConstants<T>& constants,
                                             const SharedSampleOf<Shared>& shared,
                                             const SampleNoise<T>& noise) const {
    return {
        .acceleration_S = thrust_S(constants, noise) + broadcast<T>(shared.external_S.linear_m_s2),
        .gradient_s2 = T(shared.gradient_s2),
        .radial_S = to_target(attitude_IS, broadcast<T>(shared.radial_I)),
        .omega_IS_S = omega_IS_S,
        .omega_dot_IS_S =
            torque_command_S + noise.torque_S + broadcast<T>(shared.external_S.angular_rad_s2)};
  }

  /// True angles from the reference to the satellite, rad.
  template <typename Shared>
  PROOFMASS_INLINE Vector3<T> angle_RS_S(const SharedSampleOf<Shared>& shared) const {
    const Quaternion<T> reference_IR{T(shared.attitude_IR.scalar),
                                     broadcast<T>(shared.attitude_IR.vector)};
    return error_angles(conjugate(reference_IR) * attitude_IS);
  }

  /// Advances by one sample.
  ///
  /// @param shared  Of this sample; what all runs have in common, or each lane its own.
  /// @param noise   Of this sample; its scale is in it already.
  /// @param violation  NoViolation, or a Violation in a session that tests.
  /// @param shaping  Of what the drag-free controller gets: AsMeasured, or that of a Resonator.
  /// @param hardware  PaperHardware, or a Realism.
  /// @tparam masses  `at_rest` only in a session that moves no test mass.
  /// @returns What instrument and estimator report at this sample.
  template <TestMasses masses = TestMasses::moving, typename Shared, typename Fall = NoViolation,
            typename Shaping = AsMeasured, typename Hardware = PaperHardware>
  PROOFMASS_INLINE Observation<T> advance(const LoopConstants<T>& constants,
                                          const DragFreeGains& drag_free_gains,
                                          const AttitudeGains& attitude_gains,
                                          const SharedSampleOf<Shared>& shared,
                                          const SampleNoise<T>& noise, Watch watch = Watch::yes,
                                          const Fall& violation = {}, const Shaping& shaping = {},
                                          Hardware&& hardware = {}) {
    const SatelliteMotion<T> satellite = motion(constants, shared, noise);

    Observation<T> observation;
    for (std::size_t k = 0; k < 2; ++k) {
      const SensorModel<T>& sensor = constants.sensors[k];
      Vector3<T> kinematic_S = kinematic_acceleration<masses>(sensor, satellite, shared.mass_motion,
                                                              shared.second_motion);
      if constexpr (Fall::is_active) {
        kinematic_S += violation_acceleration(k, violation.eotvos_parameter, violation.gravity_m_s2,
                                              satellite.radial_S);
      }
      observation.kinematic_S_x[k] = kinematic_S.x;
      observation.measured_K[k] = measured_acceleration(sensor, kinematic_S) + noise.sensor_K[k];
    }
    if (watch == Watch::yes) {
      for (const Vector3<T>& measured : observation.measured_K) {
        largest_acceleration = largest_magnitude(measured, largest_acceleration);
      }
      is_any_saturated = is_any_above(largest_acceleration, constants.sensor_range_m_s2);
    }
    if (is_any_saturated) [[unlikely]] {
      const T limit = limit_where_above(largest_acceleration, constants.sensor_range_m_s2);
      for (Vector3<T>& measured : observation.measured_K) measured = clamped(measured, limit);
    }
    observation.measured_omega_dot_IS_S = hardware.measured(satellite.omega_dot_IS_S) +
                                          constants.angular_bias_S_rad_s2 + noise.angular_S;

    observation.star_tracker_RS_S = hardware.seen(angle_RS_S(shared)) +
                                    constants.star_tracker_bias_S_rad + noise.star_tracker_S +
                                    broadcast<T>(shared.attitude_command_S_rad);
    estimator.correct(attitude_gains, observation.star_tracker_RS_S);
    observation.angle_RS_S = estimator.angle_RS_S;
    observation.omega_RS_S = estimator.omega_RS_S;
    if (watch == Watch::yes) largest_angle = largest_magnitude(estimator.angle_RS_S, largest_angle);
    torque_command_S = controller.advance(attitude_gains, estimator);
    estimator.predict(attitude_gains, observation.measured_omega_dot_IS_S,
                      broadcast<T>(shared.omega_IR_R));

    const Vector3<T> drag_free_input_S = constants.drag_free_weight[0] * observation.measured_K[0] +
                                         constants.drag_free_weight[1] * observation.measured_K[1] -
                                         constants.subtracted_bias_S_m_s2 +
                                         broadcast<T>(shared.drag_free_command_S_m_s2);
    const Vector3<T>& shaped_input_S = shaping(drag_free_input_S);
    thrust_command_S = drag_free.advance(drag_free_gains, shaped_input_S);
    hardware.steer(shaped_input_S, observation.angle_RS_S, thrust_command_S, torque_command_S);
    rotate(satellite.omega_dot_IS_S, attitude_gains.sample_period_s);
    hardware.actuate(constants, omega_IS_S, thrust_command_S, torque_command_S);
    return observation;
  }

  /// One sample of rotation under a constant angular acceleration, rad/s². The last term is the
  /// first of the rotation vector's series in the non-commuting rates [Bortz1971].
  PROOFMASS_INLINE void rotate(const Vector3<T>& omega_dot_IS_S, double period_s) {
    const Vector3<T> rotation =
        T(period_s) * omega_IS_S + T(0.5 * period_s * period_s) * omega_dot_IS_S +
        T(period_s * period_s * period_s / 12.0) * cross(omega_IS_S, omega_dot_IS_S);
    attitude_IS = normalised(attitude_IS * rotation_by(rotation));
    omega_IS_S += T(period_s) * omega_dot_IS_S;
  }
};

/// Constants of a run for a session: the drawn instrument as the session excites and steers it.
[[nodiscard]] LoopConstants<double> make_loop_constants(const Instrument& instrument,
                                                        const Scenario& scenario,
                                                        const Session& session);

}  // namespace proofmass
