#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/campaign/field.hpp"
#include "core/random/stream.hpp"
#include "core/runs.hpp"

namespace proofmass {

/// How the draws of a campaign's runs are chosen.
enum class DesignKind : std::uint8_t {
  random = 1,           ///< Independently.
  latin_hypercube = 2,  ///< Each quantity has one draw in each of `points` strata of its law.
  sobol = 3,            ///< A scrambled Sobol' net, which also covers pairs of quantities evenly.
};

[[nodiscard]] std::span<const std::string_view> names_of(DesignKind);

/// Most points of a replicate, 2^sobol_bits.
inline constexpr std::uint64_t design_points_max = 1024;

/// Replicates of one set of points, each randomised anew: the draws of runs r·points to
/// r·points + points − 1 are replicate r, in which each draw has the laws of the campaign and all
/// together cover them evenly. Replicates are independent of one another. More runs add replicates
/// and leave the earlier ones as they are.
struct SamplingDesign {
  DesignKind kind = DesignKind::random;
  std::uint64_t points = 1;  ///< Of a replicate; 1 for `random`, else 2 to design_points_max.

  bool operator==(const SamplingDesign&) const = default;

  /// @param num_runs  Of the campaign.
  /// @throws ConfigError naming the field, its value and the rule.
  void validate(std::uint64_t num_runs) const;
};

/// One of `count` parts of equal probability of a law, in ascending order of its values.
struct Stratum {
  std::uint64_t index = 0;
  std::uint64_t count = 1;
};

/// The stratum of a run's draw in one dimension: a pure function of its arguments.
///
///     latin_hypercube   the rank of the point among `points` random numbers, which makes each
///                       permutation of the strata as likely as any other [McKay1979]
///     sobol             Sobol's point with nested uniform scrambling [Owen1995] of the digits
///                       that tell `points` strata apart
///
/// Each stratum has one point of the replicate, so that further digits of a scrambled net are
/// independent uniform numbers: a draw within the stratum makes them.
///
/// @param dimension  Of the quantity, below sobol_dimensions.
[[nodiscard]] Stratum stratum_of(const SamplingDesign& design, std::size_t dimension,
                                 std::uint64_t seed, RunIndex run);

/// A uniform number on (0, 1) in the stratum, strictly between its ends; with a single stratum it
/// is uniform(block).
[[nodiscard]] double uniform_in(const Stratum& stratum, const RandomBlock& block);

}  // namespace proofmass
