#pragma once

#include <string>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/control/control_loops.hpp"
#include "core/microscope/control/controller.hpp"
#include "core/microscope/control/margins.hpp"
#include "core/microscope/instrument/instrument.hpp"

namespace proofmass {

struct AxisMargins {
  ControlLoop loop = ControlLoop::drag_free;
  Axis axis = Axis::x;
  Margins margins;
  std::string resonator_of;  ///< A session in which the loop has one; empty: it has none.
};

/// Of the drag-free loop in a session; none unless it tests.
[[nodiscard]] ResonatorGains resonator_in(const Scenario& scenario, const Session& session);

/// Margins of a satellite's loops, axis by axis, each by itself as sampled, with z⁻¹ until a
/// command acts; of the drag-free loop in every session that has another source or resonator:
///
///     drag-free    L = z⁻¹ C(z) R(z) y(z) [M_DF]_aa Σ_k w_k [M_k]_aa
///     attitude     L = z⁻¹ (C θ̂)(z) y(z) λ,              θ̂ for θ = ½T² z⁻¹(1 + z⁻¹)/(1 − z⁻¹)²
///
/// λ are the extreme eigenvalues of [J]⁻¹ diag[J], C is nominal or of `[[controller]]`, R that of a
/// Resonator, y the lag of Realism, and θ̂ that of AttitudeEstimator, which sees θ by the star
/// tracker with its latency and Ω̇ by the angular measurement.
[[nodiscard]] std::vector<AxisMargins> loop_margins(const Scenario& scenario,
                                                    const Instrument& instrument);

/// Time constant of the slowest mode of the loops with a perfect instrument, s: of the closed-loop
/// poles of C and the actuators' lag, and of AttitudeEstimator, without delays. Resonators, which
/// only take what the loop leaves, are not among them.
[[nodiscard]] double slowest_decay_s(const Scenario& scenario);

/// The smaller of each number.
[[nodiscard]] Margins least(const std::vector<AxisMargins>& of_axes);

}  // namespace proofmass
