#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/math/inline.hpp"
#include "core/microscope/session/session.hpp"
#include "core/microscope/session/test_signals.hpp"
#include "core/microscope/simulation/session_signals.hpp"

namespace proofmass {

// What a session that tests the equivalence principle leaves: sums of the products of the ground's
// signals (TestSignal), each averaged over windows. README.md says why windows have slopes.

/// What all runs share of a test session.
struct TestSetup {
  double semi_latus_rectum_m = 0.0;  ///< p of the orbit's r = p/(1 + e cos ν).
  double eccentricity = 0.0;
  std::size_t num_blocks = 0;  ///< Whole blocks of the record.

  /// |g| = μ/r² at O_sat, m/s².
  [[nodiscard]] PROOFMASS_INLINE double gravity_m_s2(const SharedSample& shared) const {
    const double cos_nu = shared.radial_I.x;  // X points towards perigee.
    return shared.gradient_s2 * (semi_latus_rectum_m / (1.0 + eccentricity * cos_nu));
  }
};

/// Weights of the windows of each run of T, window after window.
template <typename T>
struct WeightsOfRuns {
  std::array<const float*, sizeof(T) / sizeof(double)> runs{};

  PROOFMASS_INLINE T at(std::size_t window) const {
    std::array<double, sizeof(T) / sizeof(double)> values;
    for (std::size_t i = 0; i < runs.size(); ++i) values[i] = double{runs[i][window]};
    return __builtin_bit_cast(T, values);
  }
};

/// Sums of a test session. A window is two neighbouring blocks: its weights rise from 0 to 1 in the
/// first and fall in the second. So each signal has two sums of the open block, one with the rising
/// weights.
template <typename T>
struct TestSums {
  std::array<T, num_averaged_signals> plain{};   ///< Of the open block.
  std::array<T, num_averaged_signals> rising{};  ///< Of the open block, with rising weights.
  std::array<T, num_averaged_signals> before{};  ///< `rising` of the block before.
  std::array<T, num_test_products> products{};   ///< Over the windows, as TestProducts.
  std::size_t num_blocks = 0;                    ///< That ended.
  WeightsOfRuns<T> window_weights{};

  /// Adds the sample `k` of a block.
  PROOFMASS_INLINE void add(const std::array<T, num_averaged_signals>& values, std::size_t k,
                            const TestSetup& setup) {
    const T weight((static_cast<double>(k) + 0.5) / static_cast<double>(test_block_size));
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      plain[s] = plain[s] + values[s];
      rising[s] = rising[s] + weight * values[s];
    }
    if (k + 1 == test_block_size) end_block(setup);
  }

 private:
  PROOFMASS_INLINE void end_block(const TestSetup& setup) {
    if (num_blocks > 0) add_window(setup);
    before = rising;
    for (std::size_t s = 0; s < num_averaged_signals; ++s) plain[s] = rising[s] = T(0.0);
    ++num_blocks;
  }

  PROOFMASS_INLINE void add_window(const TestSetup& setup) {
    std::array<T, num_test_signals> means;
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      means[s] =
          T(1.0 / static_cast<double>(test_block_size)) * (before[s] + (plain[s] - rising[s]));
    }
    // Of the window's middle.
    const double time =
        2.0 * static_cast<double>(num_blocks) / static_cast<double>(setup.num_blocks) - 1.0;
    means[index(TestSignal::one)] = T(1.0);
    means[index(TestSignal::time)] = T(time);
    means[index(TestSignal::time_squared)] = T(time * time);
    means[index(TestSignal::time_cubed)] = T(time * time * time);
    const T weight = window_weights.at(num_blocks - 1);
    std::size_t at = 0;
    for (std::size_t i = 0; i < num_test_signals; ++i) {
      const T weighted = weight * means[i];
      for (std::size_t j = i; j < num_test_signals; ++j, ++at) {
        products[at] = products[at] + weighted * means[j];
      }
    }
  }
};

/// The signals of one sample of a test, those that are averaged, in the order of TestSignal.
/// @param values     ground_signals().
/// @param gravity_x  g(O_sat) along X in the estimated attitude, m/s².
template <typename T>
PROOFMASS_INLINE std::array<T, num_averaged_signals> test_signals(
    const std::array<T, num_signals>& values, const T& gravity_x) {
  const T& differential = values[index(Signal::differential_x)];
  const T& common = values[index(Signal::common_x)];
  std::array<T, num_averaged_signals> signals;
  constexpr std::size_t rows = index(Signal::gradient_yx), of_test = index(TestSignal::gradient_yx);
  for (std::size_t s = 0; s < of_test; ++s) signals[s] = values[s];  // The same in both lists.
  for (std::size_t s = 0; s < 6; ++s) signals[of_test + s] = values[rows + s];
  signals[index(TestSignal::common_squared)] = common * common;
  signals[index(TestSignal::common_product)] = common * differential;
  signals[index(TestSignal::gravity_x)] = gravity_x;
  return signals;
}

}  // namespace proofmass
