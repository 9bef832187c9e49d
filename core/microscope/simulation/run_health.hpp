#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "core/math/inline.hpp"
#include "core/math/vector3.hpp"
#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/campaign/shift_bounds.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/microscope/results/health.hpp"
#include "core/microscope/session/session.hpp"
#include "core/microscope/simulation/loop.hpp"
#include "core/signal/line_weights.hpp"

namespace proofmass {

// How well the loops held a run. LoopMonitor is filled in the sample loop, SessionHealth is what a
// session keeps of it, and judge_health() makes a verdict of that. README.md has the reasons.

/// Sums of block after block of a signal, of which only the squared steps from one block to the
/// next are kept: they are twice the variance of a block's sum, and slow changes do not count.
template <typename T>
struct BlockSteps {
  T sum{};      ///< Of the samples of this block, in the signal's unit.
  T before{};   ///< Of the block before.
  T squares{};  ///< Of the steps, in the signal's unit squared.

  PROOFMASS_INLINE void add(const T& value) { sum = sum + value; }
  PROOFMASS_INLINE void end_block(bool is_first) {
    const T step = sum - before;
    if (!is_first) squares = squares + step * step;
    before = sum;
    sum = T(0.0);
  }
};

/// What a calibration without excitation tells of the loops, sample after sample. With an
/// excitation the signals would be those of its lines.
template <typename T>
struct LoopMonitor {
  BlockSteps<T> quadratic;      ///< ½(K2_1 Γ_App,1x² − K2_2 Γ_App,2x²), m/s².
  BlockSteps<T> common_square;  ///< Γ_mes,cx², m²/s⁴.
  std::array<BlockSteps<T>, 2> sensor_square{};  ///< Γ_mes,kx², m²/s⁴.
  std::array<std::array<T, 2>, 3> residual{};    ///< Γ_mes,c at f_EP, m/s²: [axis][cosine, sine].

  /// @param weights  Cosine's and sine's weight of this sample for the line at f_EP.
  /// @tparam Weight   A double, or T where lanes are in different sessions.
  template <typename Weight>
  PROOFMASS_INLINE void add(const std::array<SensorModel<T>, 2>& sensors,
                            const Observation<T>& observation, const Weight* weights) {
    const T half = T(0.5);
    const Vector3<T>& m1 = observation.measured_K[0];
    const Vector3<T>& m2 = observation.measured_K[1];
    const Vector3<T> common = half * (m1 + m2);
    const auto square = [](const T& x) { return x * x; };
    const auto term = [&](std::size_t k) {
      return sensors[k].quadratic_s2_m.x *
             square(observation.kinematic_S_x[k] - sensors[k].parasitic_K_m_s2.x);
    };
    quadratic.add(half * (term(0) - term(1)));
    common_square.add(square(common.x));
    sensor_square[0].add(square(m1.x));
    sensor_square[1].add(square(m2.x));
    for (std::size_t i = 0; i < 2; ++i) {
      residual[0][i] = residual[0][i] + T(weights[i]) * common.x;
      residual[1][i] = residual[1][i] + T(weights[i]) * common.y;
      residual[2][i] = residual[2][i] + T(weights[i]) * common.z;
    }
  }

  PROOFMASS_INLINE void end_block(bool is_first) {
    quadratic.end_block(is_first);
    common_square.end_block(is_first);
    for (BlockSteps<T>& steps : sensor_square) steps.end_block(is_first);
  }
};

/// What is kept of one session of a run.
struct SessionHealth {
  double acceleration_m_s2 = 0.0;  ///< Largest |Γ_mes,k| of a sensor on an axis.
  double attitude_rad = 0.0;       ///< Largest |θ̂| about an axis.
  bool is_monitored = false;       ///< The rest is 0 if not.
  LoopMonitor<double> monitor{};   ///< At its end.
};

/// What is kept of the sessions of a run, in the scenario's order.
using HealthRecord = std::vector<SessionHealth>;

/// The line at f_EP in a calibration without excitation, with that session's own lines beside it.
/// Where the frame turns with the Earth's direction, so that f_EP is 0, the line is f_orb.
[[nodiscard]] LineFit residual_fit(const Scenario& scenario, const Session& session);

/// The health of a run and, if it is lost, why.
struct HealthFinding {
  LoopHealth health;
  double test_residual_m_s2 = 0.0;  ///< LoopHealth::residual_m_s2, of the sessions that test.
  LoopLoss loss;  ///< Of a saturated sensor the first session, in the scenario's order.
};

/// A run is lost if a sensor was at the end of its range, or if an effect may have moved an
/// estimate by more than ShiftBounds allows. The noise of quadratic terms is compared with that of
/// the sensors, which noise.scale multiplies.
///
/// @param bounds   Of the scenario.
/// @param record   Of scenario.sessions, in their order; as many.
/// @param phasors  Of the same run: the squared signals that the quadratic factors are found from.
/// @param truth    Of the run, SI.
/// @param standard_errors  As ShiftBounds::of() takes them.
[[nodiscard]] HealthFinding judge_health(const Scenario& scenario, const ShiftBounds& bounds,
                                         const HealthRecord& record, const RunPhasors& phasors,
                                         const ParameterArray& truth,
                                         std::span<const double> standard_errors);

}  // namespace proofmass
