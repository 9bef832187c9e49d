#pragma once

#include <array>
#include <cstddef>
#include <numbers>

#include "core/math/inline.hpp"

namespace proofmass {

/// Elementary functions in additions, multiplications and divisions alone. The C library's choose
/// an implementation by processor, and their last bits differ; these give the same bits everywhere.
/// Errors are bounded in tests/core/math/elementary_test.cpp.

template <typename T>
struct SineCosineOf {
  T sine;
  T cosine;
};
using SineCosine = SineCosineOf<double>;

/// sin and cos of 2π·turns, |turns| < 2⁴⁸; absolute error below 3e-16 for the given `turns`.
[[nodiscard]] SineCosine sincos_turns(double turns);

/// sin and cos of an angle in radians; absolute error below 3e-16 + 1.5e-16·|angle|.
[[nodiscard]] SineCosine sincos(double angle_rad);

/// eˣ for |x| < 700, relative error below 4e-16.
[[nodiscard]] double exponential(double x);

/// ln x for normal x > 0, error below 4e-16·max(|ln x|, ½).
[[nodiscard]] double logarithm(double x);

/// Coefficients 1/first!, −1/(first+2)!, 1/(first+4)!, ... of sine (first = 1) and cosine (first =
/// 0).
template <std::size_t N>
consteval std::array<double, N> alternating_factorials(int first) {
  std::array<double, N> terms{};
  double term = 1.0;
  for (std::size_t i = 0; i < N; ++i) {
    terms[i] = term;
    const double order = first + 2.0 * static_cast<double>(i);
    term = -term / ((order + 1.0) * (order + 2.0));
  }
  return terms;
}

template <std::size_t N, typename T>
PROOFMASS_INLINE T polynomial(const std::array<double, N>& coefficients, const T& x) {
  T sum = T(coefficients[N - 1]);
  for (std::size_t i = N - 1; i-- > 0;) sum = sum * x + T(coefficients[i]);
  return sum;
}

/// The arithmetic of sincos_turns(): sin and cos of 2π·(turns − ¼·quarter), `quarter` being the
/// integer next to 4·turns, by Taylor series on |x| ≤ π/4: the first dropped terms are below 2e-17.
template <typename T>
PROOFMASS_INLINE SineCosineOf<T> sincos_series(const T& turns, const T& quarter) {
  constexpr auto sine_terms = alternating_factorials<9>(1);
  constexpr auto cosine_terms = alternating_factorials<10>(0);
  const T x = T(2.0 * std::numbers::pi) * (turns - T(0.25) * quarter);  // The difference is exact.
  const T square = x * x;
  return {x * polynomial(sine_terms, square), polynomial(cosine_terms, square)};
}

}  // namespace proofmass
