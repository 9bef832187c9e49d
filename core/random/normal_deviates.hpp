#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "core/math/inline.hpp"
#include "core/random/stream.hpp"

namespace proofmass {
namespace detail {

/// ln u for 2⁻³² ≤ u ≤ 1, error below 2 units in the last place: 2 artanh(s) of the mantissa.
PROOFMASS_INLINE float log_unit(float u) {
  const auto bits = std::bit_cast<std::int32_t>(u);
  // Moves the split between exponents to √½, so that the mantissa lies in [√½, √2).
  const std::int32_t shifted = bits - 0x3f3504f3;
  const auto exponent = static_cast<float>(shifted >> 23);
  const auto m = std::bit_cast<float>((shifted & 0x007fffff) + 0x3f3504f3);
  const float s = (m - 1.0F) / (m + 1.0F);
  const float z = s * s;
  const float tail = z * (2.0F / 3 + z * (2.0F / 5 + z * (2.0F / 7 + z * (2.0F / 9))));
  return exponent * 0.693147180559945F + s * (2.0F + tail);
}

struct SineCosineFloat {
  float sine, cosine;
};

/// sin and cos of word/2³² turns, error below 1.2e-7.
PROOFMASS_INLINE SineCosineFloat sincos_word(std::uint32_t word) {
  const std::uint32_t quarter = (word + 0x20000000U) >> 30;
  const auto rest = static_cast<std::int32_t>(word - (quarter << 30));  // Within ±⅛ turn.
  const float x = static_cast<float>(rest) * 1.46291807926715968e-9F;   // 2π/2³²
  const float z = x * x;
  const float sine =
      x * (1.0F - z * (1.0F / 6 - z * (1.0F / 120 - z * (1.0F / 5040 - z * (1.0F / 362880)))));
  const float cosine =
      1.0F -
      z * (0.5F - z * (1.0F / 24 - z * (1.0F / 720 - z * (1.0F / 40320 - z * (1.0F / 3628800)))));
  const bool swapped = (quarter & 1U) != 0;
  const float first = swapped ? cosine : sine;
  const float second = swapped ? sine : cosine;
  const bool sine_negative = (quarter & 2U) != 0;
  const bool cosine_negative = ((quarter + 1U) & 2U) != 0;
  return {sine_negative ? -first : first, cosine_negative ? -second : second};
}

struct DeviatePair {
  float first, second;
};

PROOFMASS_INLINE DeviatePair box_muller(std::uint32_t radius_word, std::uint32_t angle_word) {
  // Centres of cells of width 2⁻³¹ where a float resolves them: u in [2⁻³², 1].
  const float u =
      (static_cast<float>(static_cast<std::int32_t>(radius_word >> 1)) + 0.5F) * 0x1p-31F;
  const float radius = __builtin_sqrtf(-2.0F * log_unit(u));
  const auto [sine, cosine] = sincos_word(angle_word);
  return {radius * cosine, radius * sine};
}

}  // namespace detail

/// Four independent standard normal deviates from one block, by [BoxMuller1958] in single
/// precision.
///
/// Noise of a sensor needs no 53 bits: the deviates have 24-bit mantissas, their magnitude is at
/// most 6.66, which a true normal exceeds once in 4e10 samples, and their moments and tails agree
/// with the normal law's within the resolution of 4e8 samples.
[[nodiscard]] PROOFMASS_INLINE std::array<float, 4> normal_deviates(const RandomBlock& block) {
  const detail::DeviatePair a = detail::box_muller(block[0], block[1]);
  const detail::DeviatePair b = detail::box_muller(block[2], block[3]);
  return {a.first, a.second, b.first, b.second};
}

}  // namespace proofmass
