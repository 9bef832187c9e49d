#include "core/random/stream.hpp"

namespace proofmass {

std::uint32_t stream_id(std::string_view name) {
  std::uint32_t hash = 2166136261U;
  for (const char c : name) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 16777619U;
  }
  return hash;
}

double uniform(const RandomBlock& block) {
  const std::uint64_t bits = (static_cast<std::uint64_t>(block[1]) << 32) | block[0];
  return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52;
}

}  // namespace proofmass
