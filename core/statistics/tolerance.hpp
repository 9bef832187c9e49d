#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace proofmass {

/// "At least `coverage` of all cases, with probability `confidence`": 0.99 with 0.95.
struct Tolerance {
  double coverage = 0.0;    ///< In (0, 1).
  double confidence = 0.0;  ///< In (0, 1).

  /// @throws InvalidArgument naming the field.
  void validate() const;

  /// True if something is shown whose opposite would let this happen with probability `doubt`. A
  /// probability that is 1 − confidence by its formula is not to fail for its rounding.
  [[nodiscard]] bool is_shown(double doubt) const {
    return doubt <= (1.0 - confidence) * (1.0 + 1e-12);
  }
};

/// A one-sided tolerance bound [Wilks1941].
struct ToleranceBound {
  double value = 0.0;       ///< At least `coverage` of all cases lie below it.
  std::uint64_t order = 0;  ///< 1 if it is the largest value, 2 the second largest ...
  std::size_t index = 0;    ///< Place of the value; the first of equal ones.
};

/// Largest order that is a bound among so many runs: order − 1 runs may exceed a limit and the
/// tolerance is shown all the same. 0 if there are too few runs.
[[nodiscard]] std::uint64_t wilks_order(const Tolerance& tolerance, std::uint64_t num_runs);

/// The smallest value that is a bound; empty if there are too few. Values of any law.
///
/// @param num_unknown  Runs without a value, each counted as larger than any.
/// @throws InvalidArgument if a value is not finite or the tolerance is not one.
[[nodiscard]] std::optional<ToleranceBound> wilks_upper(std::span<const double> values,
                                                        const Tolerance& tolerance,
                                                        std::uint64_t num_unknown = 0);

/// The value of this order; empty if it is 0 or one of the unknown ones.
[[nodiscard]] std::optional<ToleranceBound> upper_bound_of_order(std::span<const double> values,
                                                                 std::uint64_t order,
                                                                 std::uint64_t num_unknown);

}  // namespace proofmass
