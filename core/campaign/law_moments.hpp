#pragma once

#include <optional>

#include "core/campaign/dispersion.hpp"

namespace proofmass {

/// Mean and standard deviation of a law.
struct LawMoments {
  double mean = 0.0;
  double standard_deviation = 0.0;
};

/// Those of a valid law. Nothing for the laws `table` and `derived`, whose values follow from a
/// file or from other quantities.
///
/// A truncated normal law is integrated over the part of its interval that matters, which keeps the
/// digits far out in a tail and in slivers, where the closed form subtracts nearly equal numbers;
/// relative error of the standard deviation below 1e-6. The bits are the same on every processor.
[[nodiscard]] std::optional<LawMoments> moments_of(const Dispersion& law);

}  // namespace proofmass
