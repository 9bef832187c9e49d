#include "core/campaign/sampling_design.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>

#include "core/error.hpp"
#include "core/random/sobol.hpp"

namespace proofmass {

static_assert(design_points_max == 1U << sobol_bits);

std::span<const std::string_view> names_of(DesignKind) {
  static constexpr std::array<std::string_view, 3> names{"random", "latin_hypercube", "sobol"};
  return names;
}

void SamplingDesign::validate(std::uint64_t num_runs) const {
  if (kind == DesignKind::random) return;
  if (points < 2 || points > design_points_max) {
    throw ConfigError("campaign.points", fmt::format("{}", points),
                      fmt::format("must be in [2, {}]", design_points_max));
  }
  if (kind == DesignKind::sobol && !std::has_single_bit(points)) {
    throw ConfigError(
        "campaign.points", fmt::format("{}", points),
        "must be a power of two with campaign.design = \"sobol\", whose points are even only then");
  }
  if (num_runs % points == 0) return;
  const std::uint64_t above = (num_runs / points + 1) * points;
  throw ConfigError(
      "campaign.runs", fmt::format("{}", num_runs),
      fmt::format("must be a multiple of campaign.points, {}, with campaign.design = \"{}\": {}{}",
                  points, name_of(kind),
                  above > points ? fmt::format("{} or ", above - points) : std::string(), above));
}

namespace {

/// The bit of each digit is turned over or not by a random bit of the digits before it.
std::uint64_t scrambled(std::uint32_t value, int num_digits, const RandomStream& stream) {
  std::uint64_t result = 0;
  for (int digit = 0; digit < num_digits; ++digit) {
    // A 1 before the digits makes those of any length different numbers.
    const std::uint32_t before = 1U << digit | value >> (num_digits - digit);
    const std::uint32_t own = value >> (num_digits - 1 - digit) & 1U;
    result = result << 1 | (own ^ (stream.block(before)[0] & 1U));
  }
  return result;
}

std::uint64_t rank_of(std::uint32_t point, std::uint64_t num_points, const RandomStream& stream) {
  const auto number = [&](std::uint32_t i) {
    const RandomBlock block = stream.block(i);
    return static_cast<std::uint64_t>(block[1]) << 32 | block[0];
  };
  const std::uint64_t own = number(point);
  std::uint64_t rank = 0;
  for (std::uint32_t i = 0; i < num_points; ++i) {
    const std::uint64_t other = number(i);
    if (other < own || (other == own && i < point)) ++rank;
  }
  return rank;
}

}  // namespace

Stratum stratum_of(const SamplingDesign& design, std::size_t dimension, std::uint64_t seed,
                   RunIndex run) {
  if (design.kind == DesignKind::random) return {};
  const RunIndex replicate{run.value / design.points};
  const auto point = static_cast<std::uint32_t>(run.value % design.points);
  const RandomStream stream(seed, replicate, stream_id(fmt::format("design/{}", dimension)));
  if (design.kind == DesignKind::latin_hypercube) {
    return {.index = rank_of(point, design.points, stream), .count = design.points};
  }
  const int num_digits = std::countr_zero(design.points);
  const std::uint32_t value = sobol(point, dimension) >> (sobol_bits - num_digits);
  return {.index = scrambled(value, num_digits, stream), .count = design.points};
}

double uniform_in(const Stratum& stratum, const RandomBlock& block) {
  if (stratum.count == 1) return uniform(block);
  // Of 32 bits, so that the sum is exact and the quotient below the next stratum.
  const double within = (block[0] + 0.5) * 0x1p-32;
  return (static_cast<double>(stratum.index) + within) / static_cast<double>(stratum.count);
}

}  // namespace proofmass
