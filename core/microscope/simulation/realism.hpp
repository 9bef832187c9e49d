#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/math/vector3.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/simulation/loop.hpp"

namespace proofmass {

/// A force or torque on each axis as thrusters make it of a command u: limited to ±limit, rounded
/// to a whole number of quanta, and delayed, y ← u + e^(−T/τ)(y − u). In units of an acceleration;
/// 0 leaves a term out.
struct Actuator {
  double limit = 0.0;
  double quantum = 0.0;
  double memory = 0.0;        ///< e^(−T/τ).
  Vector3<double> delivered;  ///< y.

  const Vector3<double>& advance(const Vector3<double>& command);
};

/// Hardware of a Loop: its controllers and, with `[realism]`, what the paper's simulator
/// leaves out, for one run in one session. t is continuous over a run's sessions, each of which
/// begins where the one before ended; its settling is counted backwards from there.
///
///     star tracker        angles of m samples before, + A sin(2π t/T_orb + φ) about each axis
///     thrust, torque      an Actuator each
///     rotation            Ω̇ = [J]⁻¹ (diag[J] u − Ω × [J]Ω + m d × Γ_propu)
///     measured Ω̇         ½ Σ_k (1 + ε_k)(1 + λ[dθ_k]) Ω̇
///     drift of sensor k   b0_k(t) = b0_k + ḃ_k t,    [K1_k](t) = [K1_k] + s_k t
///
/// u is the angular acceleration that the attitude loop commands and the actuator delivers: on
/// board the diagonal of [J] is known and all else is not. Γ_propu = −[M_DF] Γ_DF here: the torque
/// of the thrust's noise is part of noise.torque_asd_rad_s2. True parameters are those of the draw,
/// t = 0.
class Realism {
 public:
  /// Without any of it: PaperHardware, but chosen while a program runs.
  Realism() = default;

  /// @param constants     Of the drawn instrument in this session.
  /// @param session       Its index.
  /// @param num_settling  Samples before its record.
  Realism(const Scenario& scenario, const Instrument& instrument,
          const LoopConstants<double>& constants, std::size_t session, std::int64_t num_settling);

  /// Sets the constants that drift to those of the next sample.
  void begin_sample(LoopConstants<double>& constants);

  /// The angles that the star tracker reports instead of those it sees now, both without errors.
  [[nodiscard]] Vector3<double> seen(const Vector3<double>& angle_RS_S);

  /// Ω̇ as measured, without bias and noise.
  [[nodiscard]] Vector3<double> measured(const Vector3<double>& omega_dot_IS_S) const {
    return is_on_ ? angular_sensitivity_ * omega_dot_IS_S : omega_dot_IS_S;
  }

  /// Replaces the commands of the axes that have a controller of their own.
  /// @param input_S     Of the drag-free controller.
  /// @param angle_RS_S  Of the attitude controller, θ̂.
  void steer(const Vector3<double>& input_S, const Vector3<double>& angle_RS_S,
             Vector3<double>& thrust_S, Vector3<double>& torque_S);

  /// Makes of the commands what acts in the next sample.
  /// @param omega_IS_S  Ω then.
  void actuate(const LoopConstants<double>& constants, const Vector3<double>& omega_IS_S,
               Vector3<double>& thrust_S, Vector3<double>& torque_S);

 private:
  struct Controller {
    ControlLoop loop;
    std::size_t axis;
    SampledController law;
  };

  std::vector<Controller> controllers_;
  bool is_on_ = false;
  RealismConfig config_;
  LoopConstants<double> at_start_;                       ///< t = 0.
  std::array<Matrix3<double>, 2> alignment_KS_{};        ///< [θ] of each sensor.
  Matrix3<double> angular_sensitivity_{};                ///< Of the mean of both sensors.
  Matrix3<double> inertia_kg_m2_{}, inverse_inertia_{};  ///< [J] and [J]⁻¹; 0 if none is given.
  double orbit_period_s_ = 1.0, sample_period_s_ = 0.0;
  double start_s_ = 0.0;   ///< t of the record's first sample.
  std::int64_t next_ = 0;  ///< Of the sample that comes next; 0 is the record's first.
  std::vector<Vector3<double>> seen_S_rad_;  ///< Angles of the last m samples.
  std::size_t oldest_ = 0;
  Actuator thrust_, torque_;
};

}  // namespace proofmass
