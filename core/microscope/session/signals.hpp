#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>

namespace proofmass {

/// What the ground uses of a session's record. Gradients are [T̂] − [În] from the estimated
/// attitude.
enum class Signal : std::size_t {
  differential_x,  ///< Γ_mes,dx, half difference, m/s².
  common_x,        ///< Γ_mes,c, half sum, m/s².
  common_y,
  common_z,
  gradient_xx,  ///< s⁻².
  gradient_xy,
  gradient_xz,
  product,      ///< The one that the session's target needs, see Product.
  gradient_yx,  ///< From here on only where SignalSet::all is recorded: 0 elsewhere.
  gradient_yy,
  gradient_yz,
  gradient_zx,
  gradient_zy,
  gradient_zz,
};

inline constexpr std::size_t num_signals = 14;
inline constexpr std::size_t num_common_signals = 8;  ///< Those of SignalSet::common.

[[nodiscard]] constexpr std::size_t index(Signal signal) {
  return static_cast<std::size_t>(signal);
}

/// The signals that are recorded in a session.
enum class SignalSet : std::uint8_t { common, all };

/// What Signal::product is: a nonlinear combination that cannot be made from phasors afterwards.
enum class Product : std::uint8_t {
  none,              ///< 0.
  common_squared,    ///< Γ_mes,cx².
  sensor_1_squared,  ///< Γ_mes,1x².
  sensor_2_squared,  ///< Γ_mes,2x².
  modulated_yy,      ///< ½([T̂]_yy − [T̂]_xx) Δ_TM sin(2π f_TM t).
  modulated_zz,      ///< ½([T̂]_zz − [T̂]_xx) Δ_TM sin(2π f_TM t).
};

inline constexpr std::size_t num_fit_lines_max = 2;       ///< Of a session.
inline constexpr std::size_t num_session_lines_max = 16;  ///< The known lines with them.

/// What is left of a session's record: amplitudes (cosine, sine) of each signal at its lines, from
/// one least-squares fit of all lines behind the session's band-pass. First come the lines of
/// Session::fit_lines, then those of Session::known_lines if they are recorded.
struct SessionPhasors {
  std::size_t num_fit_lines = 0;
  std::size_t num_lines = 0;  ///< All that are recorded; num_fit_lines or more.
  std::array<std::array<std::complex<double>, num_session_lines_max>, num_signals> amplitude{};
};

}  // namespace proofmass
