#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace proofmass {

// What the ground keeps of a session that tests the equivalence principle: sums of the products of
// these signals over the record's windows. estimation/ep_test/README.md says what they are for.

/// Signals of a test. Gradients are elements of [T̂] − [În] in S, from the estimated attitude, s⁻².
/// Products of measurements are taken before the average over a window. The first four are
/// functions of the time t, which goes from −1 to 1 over the record.
enum class TestSignal : std::size_t {
  one,
  time,
  time_squared,
  time_cubed,
  gravity_x,  ///< g(O_sat), m/s².
  gradient_xx,
  gradient_xz,
  gravity_z,
  differential_x,  ///< Γ_mes,dx, half difference (sensor 1 − sensor 2), m/s².
  common_x,        ///< Γ_mes,c, half sum, m/s².
  common_y,
  common_z,
  gradient_xy,
  gradient_yx,
  gradient_yy,
  gradient_yz,
  gradient_zx,
  gradient_zy,
  gradient_zz,
  common_squared,  ///< Γ_mes,cx², m²/s⁴.
  common_product,  ///< Γ_mes,cx Γ_mes,dx, m²/s⁴.
};

inline constexpr std::size_t num_test_signals = 21;
inline constexpr std::size_t num_powers = 4;  ///< The functions of time.
inline constexpr std::size_t num_averaged_signals = num_test_signals - num_powers;
/// Signals that others are fitted with: powers of time, gravity, gradients.
inline constexpr std::size_t num_test_columns = 8;

[[nodiscard]] constexpr std::size_t index(TestSignal signal) {
  return static_cast<std::size_t>(signal);
}

/// Products that are kept: of a column with all signals from itself on.
inline constexpr std::size_t num_test_products =
    num_test_columns * num_test_signals - num_test_columns * (num_test_columns - 1) / 2;

/// Indices of the two signals of a product.
struct SignalPair {
  std::uint8_t first;
  std::uint8_t second;  ///< Not before the first.
};

/// Of the products in their order.
inline constexpr auto test_product_pairs = [] {
  std::array<SignalPair, num_test_products> pairs{};
  std::size_t at = 0;
  const auto add_row = [&](std::size_t i) {
    for (std::size_t j = i; j < num_test_signals; ++j) {
      pairs[at++] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(j)};
    }
  };
  for (std::size_t i = 0; i < num_test_columns; ++i) add_row(i);
  return pairs;
}();

using TestProducts = std::array<double, num_test_products>;

/// What the squares do from window to window: sums over all five windows in a row of the products
/// of their fourth differences, in which nothing slow is left.
template <typename T>
struct SquareSteps {
  T weight{};   ///< Of the weights of five windows, multiplied, by which the others count.
  T common{};   ///< Of common_squared, m⁴/s⁸.
  T mixed{};    ///< Of common_squared with common_product, m⁴/s⁸.
  T product{};  ///< Of common_product, m⁴/s⁸.
};

/// The fitted regressors g_x, G_xx and G_xz of a window.
inline constexpr std::size_t num_test_regressors = 3;
using WindowRegressors = std::array<double, num_test_regressors>;

/// Sums of products of two regressors, [i][j].
using RegressorProducts = std::array<WindowRegressors, num_test_regressors>;

/// Samples of a block. A window is two neighbouring blocks long, and its weights rise in the first
/// and fall in the second.
inline constexpr std::size_t test_block_size = 16;

}  // namespace proofmass
