#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>

#include "core/math/elementary.hpp"
#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/environment/environment.hpp"
#include "core/microscope/instrument/sensor_model.hpp"
#include "core/microscope/orbit/kepler_orbit.hpp"

namespace proofmass {

/// What every run of a campaign sees alike at one sample of a session. R is the reference frame
/// that the attitude loop holds: I turned about Y at the session's spin rate. Where lanes are in
/// different sessions, T holds a number of each.
template <typename T>
struct SharedSampleOf {
  T gradient_s2{};            ///< μ/r³.
  Vector3<T> radial_I;        ///< û: unit vector from the Earth's centre to the satellite.
  Vector3<T> radial_R;        ///< û in the reference frame.
  Quaternion<T> attitude_IR;  ///< Of the reference.
  Vector3<T> omega_IR_R;      ///< Of the reference, rad/s; constant.
  /// Of a harmonic environment the components in R: what tilts S against R leaves them unchanged.
  ExternalAccelerationOf<T> external_S;
  Vector3<T> drag_free_command_S_m_s2;  ///< C_cal, added to the drag-free loop's input.
  Vector3<T> attitude_command_S_rad;    ///< Added to the star tracker's output.
  /// What the attitude command alone makes of the on-board estimate, which is linear: the ground
  /// takes it out again.
  AttitudeEstimator<T> commanded;
  MassMotionPhaseOf<T> mass_motion;  ///< Of the moving test masses.
  /// Of the second of mass_excitations(). Of stiffness, whose acceleration is in proportion to the
  /// position in the first one and which moves no mass.
  MassMotionPhaseOf<T> second_motion;
};
using SharedSample = SharedSampleOf<double>;

/// The sines and cosines of a sample: functions of its time alone, which a batch computes for many
/// samples at once.
template <typename T>
struct SamplePhasesOf {
  OrbitPointOf<T> orbit;
  SineCosineOf<T> reference;  ///< Of half the angle that the rotating frame has turned.
  /// Of the phase of each excitation; nothing beyond the session's own.
  std::array<SineCosineOf<T>, num_excitations_max> excitation;
};
using SamplePhases = SamplePhasesOf<double>;

/// Generates the samples of a session in order, from the start of settling on. The excitations run
/// while the loops settle, too.
class SessionSignals {
 public:
  SessionSignals(const Scenario& scenario, const Session& session, const KeplerOrbit& orbit,
                 const Environment& environment);

  /// Samples before the record: the first record sample has t = 0.
  [[nodiscard]] std::int64_t num_settling() const { return num_settling_; }
  /// Samples of the record, see num_record_samples().
  [[nodiscard]] std::int64_t num_record() const { return num_record_; }

  /// Attitude and rate (rad/s) of the reference.
  struct Reference {
    Quaternion<double> attitude_IR;
    Vector3<double> omega_IR_R;
  };
  /// Those at the first sample of settling.
  [[nodiscard]] Reference reference_at_start() const;

  /// The next sample; the first call yields t = −num_settling()·T.
  [[nodiscard]] SharedSample next();

  /// Writes the next samples from their phases, which phases_at() computes for many at once.
  /// @param samples  As many as phases; what no sample of the session sets is left alone.
  void next(std::span<const SamplePhases> phases, std::span<SharedSample> samples);

  /// Time of sample `ahead` of those that come next, s.
  [[nodiscard]] double time_s(std::size_t ahead) const {
    return static_cast<double>(next_ + static_cast<std::int64_t>(ahead)) * sample_period_s_;
  }

  /// Phases of a batch of times, one a lane; nothing if the orbit cannot, see
  /// KeplerOrbit::at_lanes().
  template <typename T>
  [[nodiscard]] PROOFMASS_INLINE std::optional<SamplePhasesOf<T>> phases_at(const T& time_s) const {
    const std::optional<OrbitPointOf<T>> orbit = orbit_->at_lanes(time_s);
    if (!orbit) return std::nullopt;
    SamplePhasesOf<T> phases{*orbit, reference_phase(time_s), {}};
    set_excitation_phases(time_s, phases);
    return phases;
  }

 private:
  template <typename T>
  PROOFMASS_INLINE SineCosineOf<T> reference_phase(const T& time_s) const {
    if (spin_rate_rad_s_ == 0.0) return {T(0.0), T(1.0)};
    return sincos_turns(T(0.5 * spin_rate_rad_s_) * time_s / T(2.0 * std::numbers::pi));
  }
  template <typename T>
  PROOFMASS_INLINE void set_excitation_phases(const T& time_s, SamplePhasesOf<T>& phases) const {
    for (std::size_t i = 0; i < num_excitations_; ++i) {
      phases.excitation[i] = sincos_turns(T(excitations_[i].frequency_hz) * time_s);
    }
  }

  void advance(const SamplePhases& phases, SharedSample& sample);
  [[nodiscard]] Reference reference_from(const SineCosine& phase) const;
  void excite(const SamplePhases& phases, SharedSample& sample) const;

  const KeplerOrbit* orbit_;
  Environment environment_;
  bool turns_environment_;
  AttitudeGains gains_;
  double sample_period_s_;
  double spin_rate_rad_s_;
  std::int64_t num_settling_;
  std::int64_t num_record_;
  std::int64_t next_;
  std::size_t num_excitations_ = 0;
  std::array<Excitation, num_excitations_max> excitations_{};
  bool feels_stiffness_ = false;
  bool commands_attitude_ = false;  ///< Otherwise commanded_ is 0 and remains so.
  AttitudeEstimator<double> commanded_;
};

/// Samples of a session's record. Where the orbits are no whole number of samples, the record ends
/// with the last full one.
[[nodiscard]] std::int64_t num_record_samples(const Scenario& scenario, const Session& session);

}  // namespace proofmass
