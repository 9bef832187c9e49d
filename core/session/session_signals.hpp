#pragma once

#include <cstdint>

#include "core/campaign/scenario.hpp"
#include "core/control/attitude_loop.hpp"
#include "core/environment/environment.hpp"
#include "core/instrument/sensor_model.hpp"
#include "core/math/quaternion.hpp"
#include "core/math/vector3.hpp"
#include "core/orbit/kepler_orbit.hpp"

namespace proofmass {

/// What every run of a campaign sees alike at one sample of a session.
struct SharedSample {
  double gradient_s2 = 0.0;           ///< μ/r³.
  Vector3<double> earth_direction_I;  ///< û.
  Vector3<double> earth_direction_R;  ///< The same in the frame that the attitude loop holds.
  Quaternion<double> reference_IR;    ///< Attitude of that frame.
  Vector3<double> reference_rate;     ///< Its Ω, rad/s.
  ExternalAcceleration external;
  Vector3<double> drag_free_command_m_s2;  ///< C_cal.
  Vector3<double> attitude_command_rad;    ///< Added to the star tracker's output.
  AttitudeEstimator<double> commanded;     ///< What that command alone makes of the estimate.
  MassMotionPhase mass_motion;             ///< Of the moving test masses.
};

/// Generates the samples of a session in order, from the start of settling on.
class SessionSignals {
 public:
  SessionSignals(const Scenario& scenario, const Session& session, const KeplerOrbit& orbit,
                 const Environment& environment);

  /// Samples before the record: the first record sample has t = 0.
  [[nodiscard]] std::int64_t num_settling() const { return num_settling_; }
  [[nodiscard]] std::int64_t num_record() const { return num_record_; }

  /// Attitude and rate of the reference at the first sample.
  struct Reference {
    Quaternion<double> attitude_IR;
    Vector3<double> rate;
  };
  [[nodiscard]] Reference reference_at_start() const;

  /// The next sample; the first call yields t = −num_settling()·T.
  [[nodiscard]] SharedSample next();

 private:
  [[nodiscard]] Reference reference_at(double time_s) const;
  void excite(double time_s, SharedSample& sample) const;

  const KeplerOrbit* orbit_;
  Environment environment_;
  AttitudeGains gains_;
  double sample_period_s_;
  double spin_rate_rad_s_;
  std::int64_t num_settling_;
  std::int64_t num_record_;
  std::int64_t next_;
  bool has_excitation_ = false;
  Excitation excitation_;
  AttitudeEstimator<double> commanded_;
};

/// Samples of a session's record: a whole number, the last orbit cut at the last full sample.
[[nodiscard]] std::int64_t num_record_samples(const Scenario& scenario, const Session& session);

}  // namespace proofmass
