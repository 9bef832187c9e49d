#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <string_view>

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
  square_y,  ///< K2c² along Y, s⁴/m².
  square_z,
};

inline constexpr std::size_t num_unknowns = num_parameters + 14;

[[nodiscard]] constexpr std::size_t index(Unknown unknown) {
  return static_cast<std::size_t>(unknown);
}

/// What a nuisance is, for people: `the bias of the star tracker about Z`.
/// @pre It is one of the enumerators.
[[nodiscard]] std::string_view name_of(Unknown nuisance);

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

/// Mean of Γ_mes,dx less its read-out bias, m/s²: b₁, what the mean gradient adds, and what K2d
/// makes of the mean square of what is pushed.
[[nodiscard]] Dual mean_differential(const std::array<double, num_line_bases>& means,
                                     const UnknownArray& unknowns, double mean_square_m2_s4);

/// Γ_mes,dx at a line, m/s², with its derivatives.
struct Prediction {
  std::complex<double> value{};
  std::array<std::complex<double>, num_unknowns> slope{};

  /// Adds a term.
  void add(const Dual& factor, std::complex<double> signal) {
    value += factor.value * signal;
    for (std::size_t i = 0; i < num_unknowns; ++i) slope[i] += factor.slope[i] * signal;
  }
};

/// @param line  Its squares, if it has them, about their means: see centred().
[[nodiscard]] Prediction predict(const LineCoefficients& coefficients, LineSignals signals,
                                 const LinePhasors& line);

/// What a drag-free excitation along an axis leaves of itself in the half sum along that axis,
/// m/s², before the low-pass.
struct Push {
  Axis axis = Axis::x;
  std::complex<double> at_f{};
  std::complex<double> at_2f{};         ///< Along X; else 0.
  double square_of_others_m2_s4 = 0.0;  ///< Sum of |at_f|² of further pushes along X.
};

enum class PushLine : std::uint8_t { at_f, at_2f };

/// What products of K2 add to Γ_mes,dx at a line of a push, m/s² before the low-pass: terms of the
/// third to the fifth order in its amplitude (README.md, 5a).
[[nodiscard]] Prediction push_terms(DragFreeSource source, const UnknownArray& unknowns,
                                    const Push& push, PushLine line);

/// A line of LineSignals::squares with the squares of Γ_mes,kx less its mean in place of those of
/// Γ_mes,kx itself.
[[nodiscard]] LinePhasors centred(const LinePhasors& line,
                                  const std::array<double, num_line_bases>& means);

}  // namespace proofmass
