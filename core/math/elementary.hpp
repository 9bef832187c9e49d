#pragma once

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

}  // namespace proofmass
