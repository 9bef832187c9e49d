#pragma once

#include <optional>
#include <span>

namespace proofmass {

/// Excess kurtosis, adjusted for small samples [JoanesGill1998]: the `kurtosis(bias=False)` of
/// scipy, 0 for a normal law and 6 for an exponential one. With d = x − mean:
///
///     g2 = n Σd⁴ / (Σd²)² − 3      G2 = (n − 1)/((n − 2)(n − 3)) · ((n + 1) g2 + 6)
///
/// The sums are those of moments.hpp, with the same care; for |x| between 1e-75 and 1e75.
///
/// @returns Empty below four values or if all are equal.
/// @throws InvalidArgument if a value is not finite.
[[nodiscard]] std::optional<double> excess_kurtosis(std::span<const double> values);

}  // namespace proofmass
