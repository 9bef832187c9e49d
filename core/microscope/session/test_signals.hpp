#pragma once

#include <array>
#include <cstddef>

namespace proofmass {

// What the ground keeps of a session that tests the equivalence principle: sums of the products of
// these signals over the record's windows. estimation/ep_test/README.md says what they are for.

/// Signals of a test. Gradients are elements of [T̂] − [În] in S, from the estimated attitude, s⁻².
/// Products of measurements are taken before the average over a window. The last four are functions
/// of the time t, which goes from −1 to 1 over the record.
enum class TestSignal : std::size_t {
  differential_x,  ///< Γ_mes,dx, half difference (sensor 1 − sensor 2), m/s².
  common_x,        ///< Γ_mes,c, half sum, m/s².
  common_y,
  common_z,
  gradient_xx,
  gradient_xy,
  gradient_xz,
  gradient_yx,
  gradient_yy,
  gradient_yz,
  gradient_zx,
  gradient_zy,
  gradient_zz,
  common_squared,  ///< Γ_mes,cx², m²/s⁴.
  common_product,  ///< Γ_mes,cx Γ_mes,dx, m²/s⁴.
  gravity_x,       ///< g(O_sat), m/s².
  one,
  time,
  time_squared,
  time_cubed,
};

inline constexpr std::size_t num_averaged_signals = 16;  ///< All but the functions of time.
inline constexpr std::size_t num_test_signals = 20;

[[nodiscard]] constexpr std::size_t index(TestSignal signal) {
  return static_cast<std::size_t>(signal);
}

/// Products of two signals, (0, 0), (0, 1) ... (1, 1), (1, 2) ...
inline constexpr std::size_t num_test_products = num_test_signals * (num_test_signals + 1) / 2;
using TestProducts = std::array<double, num_test_products>;

/// The fitted regressors g_x, G_xx and G_xz of a window.
inline constexpr std::size_t num_test_regressors = 3;
using WindowRegressors = std::array<double, num_test_regressors>;

/// Sums of products of two regressors, [i][j].
using RegressorProducts = std::array<WindowRegressors, num_test_regressors>;

/// Samples of a block. A window is two neighbouring blocks long, and its weights rise in the first
/// and fall in the second.
inline constexpr std::size_t test_block_size = 16;

}  // namespace proofmass
