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
/// first and fall in the second.
template <typename T>
struct TestSums {
  using Averaged = std::array<T, num_averaged_signals>;

  /// Samples of the open block that are not in the sums yet: a sum is read and written once for
  /// all.
  static constexpr std::size_t num_pending = 4;
  static_assert(test_block_size % num_pending == 0);
  std::array<Averaged, num_pending> pending{};
  Averaged plain{};  ///< Of the open block.
  /// Of `plain` after each sample of the open block: in it the sample k of n counts n − k times.
  Averaged of_plain{};
  Averaged rising{};                            ///< Of the block before, with rising weights.
  std::array<T, num_test_products> products{};  ///< Over the windows, as TestProducts.
  struct Squares {
    T weight{}, common{}, product{};
  };
  std::array<Squares, 4> squares_before{};  ///< Of the windows before, the last one first.
  SquareSteps<T> steps{};
  std::size_t num_blocks = 0;  ///< That ended.
  WeightsOfRuns<T> window_weights{};

  /// Adds the sample `k` of a block.
  PROOFMASS_INLINE void add(const Averaged& values, std::size_t k, const TestSetup& setup) {
    Averaged& kept = pending[k % num_pending];
    // One loop more than the compiler unrolls by itself, and the values would be written twice.
#pragma GCC unroll 32
    for (std::size_t s = 0; s < num_averaged_signals; ++s) kept[s] = values[s];
    if ((k + 1) % num_pending == 0) add_pending();
    if (k + 1 == test_block_size) end_block(setup);
  }

 private:
  PROOFMASS_INLINE void add_pending() {
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      T sum = plain[s], sum_of_sums = of_plain[s];
      for (const Averaged& values : pending) {
        sum = sum + values[s];
        sum_of_sums = sum_of_sums + sum;
      }
      plain[s] = sum;
      of_plain[s] = sum_of_sums;
    }
  }

  PROOFMASS_INLINE void end_block(const TestSetup& setup) {
    Averaged falling;
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      falling[s] =
          T(1.0 / static_cast<double>(test_block_size)) * (of_plain[s] - T(0.5) * plain[s]);
    }
    if (num_blocks > 0) add_window(falling, setup);
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      rising[s] = plain[s] - falling[s];
      plain[s] = of_plain[s] = T(0.0);
    }
    ++num_blocks;
  }

  PROOFMASS_INLINE void add_window(const Averaged& falling, const TestSetup& setup) {
    // Of the window's middle.
    const double time =
        2.0 * static_cast<double>(num_blocks) / static_cast<double>(setup.num_blocks) - 1.0;
    std::array<T, num_test_signals> means{T(1.0), T(time), T(time * time), T(time * time * time)};
    for (std::size_t s = 0; s < num_averaged_signals; ++s) {
      means[num_powers + s] =
          T(1.0 / static_cast<double>(test_block_size)) * (rising[s] + falling[s]);
    }
    const T weight = window_weights.at(num_blocks - 1);
    std::size_t k = 0;  // Of the products, in the order of test_product_pairs.
    for (std::size_t i = 0; i < num_test_columns; ++i) {
      const T weighted = weight * means[i];
      for (std::size_t j = i; j < num_test_signals; ++j, ++k) {
        products[k] = products[k] + weighted * means[j];
      }
    }
    add_step({weight, means[index(TestSignal::common_squared)],
              means[index(TestSignal::common_product)]});
  }

  PROOFMASS_INLINE void add_step(const Squares& now) {
    const std::array<Squares, 4>& last = squares_before;
    const T weight = now.weight * last[0].weight * last[1].weight * last[2].weight * last[3].weight;
    const T common = now.common - T(4.0) * (last[0].common + last[2].common) +
                     T(6.0) * last[1].common + last[3].common;
    const T product = now.product - T(4.0) * (last[0].product + last[2].product) +
                      T(6.0) * last[1].product + last[3].product;
    steps.weight = steps.weight + weight;
    steps.common = steps.common + weight * common * common;
    steps.mixed = steps.mixed + weight * common * product;
    steps.product = steps.product + weight * product * product;
    squares_before = {now, last[0], last[1], last[2]};
  }
};

/// The signals of one sample of a test, those that are averaged, in the order of TestSignal.
/// @param values        ground_signals().
/// @param gravity_m_s2  |g(O_sat)|.
/// @param radial_S      û in the estimated attitude.
template <typename T>
PROOFMASS_INLINE std::array<T, num_averaged_signals> test_signals(
    const std::array<T, num_signals>& values, double gravity_m_s2, const Vector3<T>& radial_S) {
  const auto at = [&](Signal signal) { return values[index(signal)]; };
  const T differential_x = at(Signal::differential_x), common_x = at(Signal::common_x);
  return {T(-gravity_m_s2) * radial_S.x, at(Signal::gradient_xx),  at(Signal::gradient_xz),
          T(-gravity_m_s2) * radial_S.z, differential_x,           common_x,
          at(Signal::common_y),          at(Signal::common_z),     at(Signal::gradient_xy),
          at(Signal::gradient_yx),       at(Signal::gradient_yy),  at(Signal::gradient_yz),
          at(Signal::gradient_zx),       at(Signal::gradient_zy),  at(Signal::gradient_zz),
          common_x * common_x,           common_x * differential_x};
}

}  // namespace proofmass
