#pragma once

#include <cstdint>
#include <string_view>

namespace proofmass {

/// Where a hash FNV-1a of 64 bits [RFC 9923] begins. It guards against accidents, not against
/// malice.
inline constexpr std::uint64_t fnv1a_basis = 0xcbf29ce484222325;

/// The hash after one more byte. Where nobody else computes the same hash, a part may be a word of
/// 64 bits.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::uint64_t hash, std::uint64_t part) {
  return (hash ^ part) * 0x100000001b3;
}

/// The hash of bytes.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::string_view bytes) {
  std::uint64_t hash = fnv1a_basis;
  for (const char byte : bytes) hash = fnv1a(hash, static_cast<unsigned char>(byte));
  return hash;
}

/// The mixing of SplitMix64 [Steele2014]: a number without visible relation to its argument.
[[nodiscard]] constexpr std::uint64_t mixed(std::uint64_t number) {
  number += 0x9e3779b97f4a7c15;
  number = (number ^ (number >> 30)) * 0xbf58476d1ce4e5b9;
  number = (number ^ (number >> 27)) * 0x94d049bb133111eb;
  return number ^ (number >> 31);
}

/// A number in [0, 1) made of the upper 53 bits.
[[nodiscard]] constexpr double fraction_of(std::uint64_t bits) {
  return static_cast<double>(bits >> 11) * 0x1.0p-53;
}

}  // namespace proofmass
