#pragma once

#include <cstddef>
#include <cstdint>

namespace proofmass {

/// Axes of the satellite frame S (and, for a test mass, of its sensor frame). X is sensitive, X and
/// Z span the orbital plane, Y is normal to it.
enum class Axis : std::uint8_t { x = 1, y = 2, z = 3 };

/// 0, 1 or 2.
[[nodiscard]] constexpr std::size_t index(Axis axis) { return static_cast<std::size_t>(axis) - 1; }

/// What a session shakes.
enum class ExcitationKind : std::uint8_t {
  attitude = 1,   ///< Angle added to the star tracker's output, rad.
  drag_free = 2,  ///< Acceleration C_cal added to the drag-free loop's input, m/s².
  test_mass = 3,  ///< Motion of the test masses in their sensors, m.
};

/// Which test masses move, and how: s_k of q_k(t) = [θ_k]ᵀ e_a s_k Δ_TM sin(2π f t).
enum class MassMotion : std::uint8_t {
  opposition = 1,  ///< s = (−½, +½): the relative motion has the full amplitude.
  mass_1 = 2,      ///< s = (1, 0), the inner mass.
  mass_2 = 3,      ///< s = (0, 1), the outer mass.
};

/// The measurement that the drag-free loop nulls.
enum class DragFreeSource : std::uint8_t { common = 1, sensor_1 = 2, sensor_2 = 3 };

/// A sine a·sin(2π f t), with t = 0 at the session's start.
struct Excitation {
  ExcitationKind kind = ExcitationKind::drag_free;
  Axis axis = Axis::x;
  double amplitude = 0.0;  ///< rad, m/s² or m, according to `kind`; > 0.
  double frequency_hz = 0.0;
  MassMotion motion = MassMotion::opposition;  ///< For `test_mass` only.

  bool operator==(const Excitation&) const = default;
};

/// Excitations of one session at most.
inline constexpr std::size_t num_excitations_max = 4;

}  // namespace proofmass
