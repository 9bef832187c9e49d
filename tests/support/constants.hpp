#pragma once

#include <numbers>

#include "core/math/vector3.hpp"

namespace proofmass {

inline constexpr double pi = std::numbers::pi;
inline constexpr double two_pi = 2.0 * pi;
/// Of the samples that tests of loops, noise and estimates use, unless they say otherwise.
inline constexpr double period_s = 0.25;
inline constexpr Vector3<double> zero{};

}  // namespace proofmass
