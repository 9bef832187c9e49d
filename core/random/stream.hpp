#pragma once

#include <Random123/philox.h>

#include <array>
#include <cstdint>
#include <string_view>

#include "core/math/inline.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// 128 random bits.
using RandomBlock = std::array<std::uint32_t, 4>;

/// Philox4x32-10 [Salmon2011]: a bijection of the counter for every key, used as a random function.
[[nodiscard]] PROOFMASS_INLINE RandomBlock philox(const RandomBlock& counter, std::uint64_t key) {
  const r123::Philox4x32::ctr_type c{{counter[0], counter[1], counter[2], counter[3]}};
  const r123::Philox4x32::key_type k{
      {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)}};
  const auto r = r123::Philox4x32{}(c, k);
  return {r[0], r[1], r[2], r[3]};
}

/// Number of a stream, from its name (32-bit FNV-1a). Adding a stream changes no other one.
[[nodiscard]] std::uint32_t stream_id(std::string_view name);

/// The random numbers of one name in one run: block i is a pure function of (seed, run, name, i),
/// so any part of any run can be computed alone.
class RandomStream {
 public:
  PROOFMASS_INLINE RandomStream(std::uint64_t seed, RunIndex run, std::uint32_t id)
      : key_(seed),
        id_(id),
        run_low_(static_cast<std::uint32_t>(run.value)),
        run_high_(static_cast<std::uint32_t>(run.value >> 32)) {}

  [[nodiscard]] PROOFMASS_INLINE RandomBlock block(std::uint32_t index) const {
    return philox({index, id_, run_low_, run_high_}, key_);
  }

 private:
  std::uint64_t key_;
  std::uint32_t id_, run_low_, run_high_;
};

/// Uniform on (0, 1), never an end: the centres of 2⁵² equal cells, from the first 64 bits.
[[nodiscard]] double uniform(const RandomBlock& block);

/// x with Φ(x) = probability, for 0 < probability < 1 [Wichura1988] (algorithm AS 241, PPND16);
/// relative error below 1e-15, so monotone down to that. One uniform to one normal: for drawn
/// parameters.
[[nodiscard]] double inverse_normal(double probability);

}  // namespace proofmass
