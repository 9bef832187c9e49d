#include "core/random/sobol.hpp"

#include <array>
#include <boost/random/sobol.hpp>
#include <vector>

#include "core/error.hpp"

namespace proofmass {
namespace {

using DirectionNumbers = std::array<std::uint32_t, sobol_bits>;

/// Bits of the engine's coordinates. It writes beyond its memory if these are fewer than the degree
/// of the polynomial of a dimension, 11 for the last ones.
constexpr int engine_bits = 32;

/// Boost's engine goes through the points in the order of the Gray code and begins after the
/// origin: its points 2ᵇ − 1 and 2ᵇ, counted from the origin, differ by direction number b.
std::vector<DirectionNumbers> direction_numbers() {
  boost::random::sobol_engine<std::uint32_t, engine_bits> next(sobol_dimensions);
  std::vector<DirectionNumbers> numbers(sobol_dimensions);
  std::vector<std::uint32_t> before(sobol_dimensions);
  std::size_t bit = 0;
  for (std::uint32_t point = 1; bit < sobol_bits; ++point) {
    const bool is_power_of_two = point == std::uint32_t{1} << bit;
    for (std::size_t dimension = 0; dimension < sobol_dimensions; ++dimension) {
      const std::uint32_t coordinate = next();
      if (is_power_of_two) {
        numbers[dimension][bit] = (coordinate ^ before[dimension]) >> (engine_bits - sobol_bits);
      }
      before[dimension] = coordinate;
    }
    if (is_power_of_two) ++bit;
  }
  return numbers;
}

}  // namespace

std::uint32_t sobol(std::uint32_t point, std::size_t dimension) {
  static const std::vector<DirectionNumbers> numbers = direction_numbers();
  PROOFMASS_EXPECT(point >> sobol_bits == 0 && dimension < sobol_dimensions);
  std::uint32_t coordinate = 0;
  for (std::size_t bit = 0; bit < sobol_bits; ++bit) {
    if ((point >> bit & 1U) != 0) coordinate ^= numbers[dimension][bit];
  }
  return coordinate;
}

}  // namespace proofmass
