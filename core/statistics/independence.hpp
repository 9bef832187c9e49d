#pragma once

#include <span>
#include <string>

namespace proofmass {

/// P-values that a column of independent draws, of whatever law, looks like a design or a series
/// as much as these values do. README.md says what they find.
struct IndependencePValues {
  double serial = 1.0;   ///< Correlation of the ranks of values 1 to 5 rows apart.
  double regular = 1.0;  ///< Values that cover their range more evenly than chance.
};

/// Below 20 values nothing is tested.
/// @throws InvalidArgument if a value is not finite.
[[nodiscard]] IndependencePValues independence_p_values(std::span<const double> values);

/// Why a column is not taken for independent: `depends on the order of its rows, p = 1e-05`, or
/// that it is too even; empty if it is.
[[nodiscard]] std::string why_dependent(std::span<const double> values);

/// A column is taken for dependent where a p-value is below: one of 5,000 columns of independent
/// draws at most is refused by mistake.
inline constexpr double independence_p_value_min = 1e-4;

}  // namespace proofmass
