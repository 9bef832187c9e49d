#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace proofmass {

/// The values in ascending order.
/// @throws InvalidArgument if there is no value or one is not finite.
[[nodiscard]] std::vector<double> sorted(std::span<const double> values);

/// Percentile by linear interpolation between x₍₁₊₍ₙ₋₁₎ₚ₎'s neighbours: definition 7 of
/// [HyndmanFan1996], the default of numpy and R.
///
/// @param ascending  From sorted().
/// @param level      In [0, 1]: 0.95 for the 95th percentile.
/// @throws InvalidArgument if there is no value or the level is outside.
[[nodiscard]] double percentile(std::span<const double> ascending, double level);

/// A value between those of two places in ascending order, counted from 0.
struct OrderPlace {
  std::size_t from = 0;
  std::size_t to = 0;
  double weight = 0.0;  ///< Of the value at `to`, in [0, 1].

  [[nodiscard]] double between(double value_from, double value_to) const {
    return weight == 0.0 ? value_from : value_from + weight * (value_to - value_from);
  }
};

/// Where percentile() finds a percentile of `count` > 0 values.
/// @throws InvalidArgument if the level is outside [0, 1].
[[nodiscard]] OrderPlace percentile_place(std::size_t count, double level);

/// Positions of the values in ascending order; equal values keep their order.
[[nodiscard]] std::vector<std::size_t> ascending_order(std::span<const double> values);

/// Rank of each value, from 1; equal values share the average of their ranks.
[[nodiscard]] std::vector<double> average_ranks(std::span<const double> values);

}  // namespace proofmass
