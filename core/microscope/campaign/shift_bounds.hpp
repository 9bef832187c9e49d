#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/instrument/drawn_quantities.hpp"
#include "core/microscope/results/health.hpp"
#include "core/microscope/results/results.hpp"

namespace proofmass {

/// What may move an estimate beside the noise of the sensors. README.md derives the bounds.
enum class Effect : std::uint8_t {
  residual,         ///< What the drag-free loop leaves, through the quadratic factors.
  attitude,         ///< A large angle, through what the attitude's equations leave out.
  quadratic_noise,  ///< Noise that the quadratic factors make of what the loop leaves.
  square_noise,     ///< Noise of a squared measurement, which scales a quadratic factor.
  spin,             ///< Centrifugal and Coriolis accelerations, through the quadratic factors.
};

inline constexpr std::size_t num_effects = 5;

/// `residual`, for people and files.
[[nodiscard]] std::string_view name_of(Effect effect);

/// How far an effect may have moved an estimate.
struct Shift {
  Effect effect;
  Parameter parameter;
  double part;          ///< Of the parameter's objective.
  double part_of_loss;  ///< A run is lost if `part` is above this.
};

/// Part of an objective from which a shift is worth a warning. Errors that have nothing to do with
/// each other add up in squares: a tenth makes an error at its objective larger by half a percent.
inline constexpr double warned_part = 0.1;

/// Bounds the shifts of a campaign's runs: pure functions of the scenario, the health of a run and
/// its truth.
class ShiftBounds {
 public:
  /// @pre scenario.validate() passed, and the laws are valid.
  ShiftBounds(const Scenario& scenario, const DispersionSet& dispersions);

  /// Every shift of the ten parameters that is not 0, in the order of effects. Parts may be
  /// infinite.
  /// @param truth            Of each parameter, SI.
  /// @param standard_errors  Of each estimate, of a method that has them: what bounds its shifts.
  ///                         Else none.
  [[nodiscard]] std::vector<Shift> of(const LoopHealth& health, std::span<const double> truth,
                                      std::span<const double> standard_errors) const;

  /// The shift of δ that one of a_d1j makes in the tests, a part of the objective of δ; 0 of other
  /// parameters.
  /// @param test_residual_m_s2  Of the run.
  [[nodiscard]] double part_of_test(const Shift& shift, double test_residual_m_s2) const;

 private:
  /// The sessions of a target together.
  struct Sensitivity {
    /// Shift of the target by a disturbance of 1 m/s² at its line, at most.
    double of_line = 0.0;
    double of_noise = 0.0;      ///< Standard error by noise of 1 (m/s²)²/Hz.
    double sensor_sigma = 0.0;  ///< That by the sensors' noise, with its scale.
  };
  class Sum;

  void add_session(const Scenario& scenario, const Session& session);
  void add_spin(const Scenario& scenario, const Session& session);
  [[nodiscard]] const Sensitivity& of(Parameter parameter) const {
    return sensitivities_[static_cast<std::size_t>(parameter)];
  }
  [[nodiscard]] Sensitivity sensitivity(double standard_error) const;
  void add_residual(double residual_m_s2, Sum& sum) const;
  void add_noises(const LoopHealth& health, Sum& sum) const;

  ParameterArray objectives_;
  std::array<Sensitivity, num_parameters> sensitivities_{};
  double least_density_;  ///< Of which LoopHealth::quadratic_noise is a multiple.
  double block_s_;        ///< Duration of a block of BlockSteps.
  /// Largest line of Γ_mes,cx at 2 f_EP that is known beforehand, m/s², and what of the square of a
  /// line there BlockSteps take for a density.
  double known_line_m_s2_ = 0.0;
  double step_share_ = 0.0;
  double white_density_;  ///< Of Γ_mes,dx, below that of every line; of scale 1 without noise.
  double duration_s_;     ///< Of the records of all sessions that are fitted.
  double differential_bias_m_s2_;  ///< Largest |b_1d| that the laws allow.
  bool has_noise_;
  double gradient_line_s2_;  ///< Amplitude of ½T_xx and ½T_xz at 2 f_EP, on a circular orbit.
  /// Largest (ω² + |k/m|)Δ_TM of the masses that move along each axis.
  std::array<double, 3> mass_acceleration_m_s2_{};
  double of_sidebands_ = 0.0;    ///< Shift of a_d11' by a line of 1 m/s² for K2d = 1 s²/m.
  double delta_per_m_s2_ = 0.0;  ///< 2/g: δ that 1 m/s² makes.
  double delta_objective_;
  /// Shifts by spin for K2c = 1 s²/m and, but for a_c13, Δx = 1 m.
  ParameterArray of_spin_{};
};

/// The session that finds a parameter; of K2c the first.
[[nodiscard]] SessionTarget finding_session(Parameter parameter);

/// Density of the noise of ½(Γ_mes,1x − Γ_mes,2x) where it is least among the lines of all
/// sessions, (m/s²)²/Hz.
[[nodiscard]] double least_noise_density(const Scenario& scenario);

}  // namespace proofmass
