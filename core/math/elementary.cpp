#include "core/math/elementary.hpp"

#include <cmath>
#include <cstdint>
#include <numbers>

namespace proofmass {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

}  // namespace

SineCosine sincos_turns(double turns) {
  // Adding and taking away 1.5·2⁵² rounds to an integer.
  const double quarter = (4.0 * turns + 0x1.8p52) - 0x1.8p52;
  const auto [sine, cosine] = sincos_series(turns, quarter);
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
