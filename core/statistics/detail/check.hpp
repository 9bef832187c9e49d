#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace proofmass::detail {

/// @throws InvalidArgument if there are fewer than `num_min` values or one is not finite:
/// `values = 1 value (must be at least 2)`, `values[7] = nan (must be finite)`.
void check_values(std::string_view name, std::span<const double> values, std::size_t num_min);

/// @throws InvalidArgument unless both have the same number of values.
void check_same_size(std::string_view name, std::span<const double> values,
                     std::span<const double> others);

/// True if not all values are the same.
/// @pre There is one.
[[nodiscard]] bool varies(std::span<const double> values);

/// @throws InvalidArgument unless 0 < value < 1; for levels and confidences.
void check_fraction(std::string_view name, double value);

}  // namespace proofmass::detail
