#pragma once

#include <functional>
#include <vector>

#include "core/math/complex.hpp"

namespace proofmass {

/// An open loop L of z⁻¹, so that 1/(1 + L) is left of a disturbance. L vanishes for z → ∞ and has
/// no pole outside the unit circle.
using OpenLoop = std::function<ComplexDouble(ComplexDouble z_inverse)>;

/// Roots of an open loop near the unit circle, where it turns within less than any grid of angles
/// resolves: z of the upper one of each conjugate pair. Others than these do no harm.
struct Resonances {
  std::vector<ComplexDouble> poles, zeros;
};

/// How far a closed loop is from instability.
struct Margins {
  /// The least factor above 1 by which L may grow or shrink; 0: it is unstable.
  double gain = 0.0;
  /// The least phase that L may lose or gain where |L| is 1; 0 likewise; π if that is nowhere, so
  /// that the loop is open in effect.
  double phase_rad = 0.0;
};

/// Margins from L along the unit circle, from 1e-8 of a turn on, where loops with an integral are
/// far above 1. A closed loop counts as unstable if 1 + L has a zero at |z| > 1 + 1e-6, that is, if
/// something grows by e within some days; 1 + L then winds about 0 along that circle.
///
/// @param resonances  Of L.
[[nodiscard]] Margins margins_of(const OpenLoop& open_loop, const Resonances& resonances = {});

}  // namespace proofmass
