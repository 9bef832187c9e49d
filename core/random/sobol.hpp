#pragma once

#include <cstddef>
#include <cstdint>

namespace proofmass {

/// Bits of a coordinate of sobol().
inline constexpr int sobol_bits = 10;

/// Dimensions that sobol() has.
inline constexpr std::size_t sobol_dimensions = 256;

/// A coordinate of a point of Sobol's sequence in units of 2⁻¹⁰, with the direction numbers of
/// [JoeKuo2008] as Boost.Random has them. Point 0 is the origin. The first 2ᵐ points have the 2ᵐ
/// multiples of 2⁻ᵐ in each dimension.
///
/// @param point  Below 2¹⁰.
[[nodiscard]] std::uint32_t sobol(std::uint32_t point, std::size_t dimension);

}  // namespace proofmass
