#pragma once

#include <array>
#include <complex>
#include <cstddef>

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
  regressor,    ///< The session's own: a squared measurement or a modulated gradient.
  gradient_yx,  ///< From here on for the off-centring sessions only: 0 in the others.
  gradient_yy,
  gradient_yz,
  gradient_zx,
  gradient_zy,
  gradient_zz,
};

inline constexpr std::size_t num_signals = 14;
inline constexpr std::size_t num_common_signals = 8;  ///< Those that every session uses.
inline constexpr std::size_t num_fit_lines_max = 2;

[[nodiscard]] constexpr std::size_t index(Signal signal) {
  return static_cast<std::size_t>(signal);
}

/// Amplitudes (cosine, sine) of each signal at each line that a session fits: what is left of a
/// record.
struct SessionPhasors {
  std::size_t num_lines = 0;
  std::array<std::array<std::complex<double>, num_fit_lines_max>, num_signals> amplitude{};
};

}  // namespace proofmass
