#include "core/math/elementary.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace proofmass {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// Coefficients 1/first!, −1/(first+2)!, 1/(first+4)!, ... of sine (first = 1) and cosine (first =
/// 0).
template <std::size_t N>
constexpr std::array<double, N> alternating_factorials(int first) {
  std::array<double, N> terms{};
  double term = 1.0;
  for (std::size_t i = 0; i < N; ++i) {
    terms[i] = term;
    const double order = first + 2.0 * static_cast<double>(i);
    term = -term / ((order + 1.0) * (order + 2.0));
  }
  return terms;
}

template <std::size_t N>
double polynomial(const std::array<double, N>& coefficients, double x) {
  double sum = coefficients[N - 1];
  for (std::size_t i = N - 1; i-- > 0;) sum = sum * x + coefficients[i];
  return sum;
}

}  // namespace

SineCosine sincos_turns(double turns) {
  // Taylor series on |x| ≤ π/4: the first dropped terms are below 2e-17.
  static constexpr auto sine_terms = alternating_factorials<9>(1);
  static constexpr auto cosine_terms = alternating_factorials<10>(0);
  // Adding and taking away 1.5·2⁵² rounds to an integer.
  const double quarter = (4.0 * turns + 0x1.8p52) - 0x1.8p52;
  const double x = two_pi * (turns - 0.25 * quarter);  // The difference is exact.
  const double square = x * x;
  const double sine = x * polynomial(sine_terms, square);
  const double cosine = polynomial(cosine_terms, square);
  switch (static_cast<std::int64_t>(quarter) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

SineCosine sincos(double angle_rad) { return sincos_turns(angle_rad / two_pi); }

double exponential(double x) {
  // x = k·ln 2 + r with |r| ≤ ½ ln 2; ln 2 in two parts, the first short enough for k·ln2_high to
  // be exact.
  constexpr double ln2_high = 0x1.62e42feep-1;
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  const double k = std::floor(x / std::numbers::ln2 + 0.5);
  const double r = (x - k * ln2_high) - k * ln2_low;
  double sum = 1.0;
  for (int order = 14; order >= 1; --order) sum = 1.0 + sum * r / order;
  return std::ldexp(sum, static_cast<int>(k));
}

double logarithm(double x) {
  // x = 2ᵏ·m with m in [√½, √2); ln m = 2 artanh(s), s = (m − 1)/(m + 1), |s| < 0.172.
  int k = 0;
  double m = std::frexp(x, &k);
  if (m < std::numbers::sqrt2 / 2.0) {
    m *= 2.0;
    --k;
  }
  const double s = (m - 1.0) / (m + 1.0);
  const double square = s * s;
  double sum = 0.0;
  for (int order = 23; order >= 3; order -= 2) sum = (sum + 2.0 / order) * square;
  constexpr double ln2_high = 0x1.62e42feep-1;
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  return k * ln2_high + (s * (2.0 + sum) + k * ln2_low);
}

}  // namespace proofmass
