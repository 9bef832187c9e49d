#pragma once

#include <cstddef>

namespace proofmass {

/// Largest magnitude that a drawn quantity may have, in its unit: 1,000 times the bound of its
/// nominal law, far beyond any instrument and wide enough for any experiment with the model. An
/// offcentring of 5 m is a slip of the pen.
///
/// @param quantity  Its place in drawn_names().
[[nodiscard]] double drawn_magnitude_max(std::size_t quantity);

}  // namespace proofmass
