#pragma once

#include <array>
#include <complex>
#include <cstddef>

#include "core/microscope/instrument/instrument.hpp"
#include "core/microscope/results/results.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

/// What the joint fit adjusts: the ten parameters in their order, then the nuisances, which have
/// priors. README.md defines them.
enum class Unknown : std::size_t {
  motion_gain = num_parameters,  ///< k = a_c11 − 1.
  coupling_z,                    ///< η_cz, rad.
  coupling_y,                    ///< η_cy, rad.
  alignment_x,                   ///< θ_cx, rad.
  tilt_x,                        ///< β: bias of the fused star tracker about X, rad.
  tilt_y,
  tilt_z,
  differential_bias,  ///< b₁, m/s².
  parasitic_y,        ///< p_y, m/s².
  parasitic_z,
  scale_y,  ///< ε_y, the part by which K2 changes the scale of Γ_mes,cy.
  scale_z,
};

inline constexpr std::size_t num_unknowns = num_parameters + 12;

[[nodiscard]] constexpr std::size_t index(Unknown unknown) {
  return static_cast<std::size_t>(unknown);
}

/// One value for each unknown, SI.
using UnknownArray = std::array<double, num_unknowns>;

/// What the unknowns of an instrument are, but for the tilt of its star tracker, which is 0; see
/// true_parameters() for the offset.
[[nodiscard]] UnknownArray true_unknowns(const Instrument& instrument, double common_offset_x_m_s2);

/// A number with its derivatives by all unknowns: arithmetic on it yields the exact Jacobian.
struct Dual {
  double value = 0.0;
  UnknownArray slope{};

  Dual() = default;
  Dual(double constant) : value(constant) {}  // NOLINT(google-explicit-constructor)
};

/// What multiplies the recorded signals of a line in the model of Γ_mes,dx.
struct LineCoefficients {
  std::array<Dual, 3> common;     ///< Of Γ_mes,c.
  std::array<Dual, 9> gradients;  ///< Of [T̂] − [În], row by row.
  std::array<Dual, 2> squares;    ///< Of the squares, about their means.
  /// Of LineSignals::moved, and of moved_again.
  std::array<std::array<Dual, 9>, num_mass_motions_max> moved;
};

/// The coefficients of a session.
/// @param means  SessionPhasors::means of the session.
/// @param found  drag_free_of_a_d11_prime() of all sessions.
[[nodiscard]] LineCoefficients line_coefficients(const Session& session,
                                                 const std::array<double, num_line_bases>& means,
                                                 const UnknownArray& unknowns,
                                                 DragFreeSource found = DragFreeSource::common);

/// Constant part b of the differential acceleration, m/s²: b₁ and what the mean gradient adds.
[[nodiscard]] Dual differential_constant(const std::array<double, num_line_bases>& means,
                                         const UnknownArray& unknowns);

/// Γ_mes,dx at a line, m/s², with its derivatives.
struct Prediction {
  std::complex<double> value{};
  std::array<std::complex<double>, num_unknowns> slope{};
};

/// @param line  Its squares, if it has them, about their means: see centred().
[[nodiscard]] Prediction predict(const LineCoefficients& coefficients, LineSignals signals,
                                 const LinePhasors& line);

/// A line of LineSignals::squares with the squares of Γ_mes,kx less its mean in place of those of
/// Γ_mes,kx itself.
[[nodiscard]] LinePhasors centred(const LinePhasors& line,
                                  const std::array<double, num_line_bases>& means);

}  // namespace proofmass
