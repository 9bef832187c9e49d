#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/microscope/session/excitation.hpp"
#include "core/microscope/session/signals.hpp"

namespace proofmass {

/// The quantity that a session's lines determine. The two K2 slopes yield K2c together. The values
/// are stored and sent: never renumber.
enum class SessionTarget : std::uint8_t {
  a_c11_delta_x = 1,
  a_c11_delta_z = 2,
  a_c11_delta_y = 3,
  a_c12 = 4,
  a_c13 = 5,
  a_d11_prime = 6,
  a_d12 = 7,
  a_d13 = 8,
  k2d = 9,
  k2_sensor_1 = 10,  ///< K21/K11², mass 1 moving, drag-free on mass 2.
  k2_sensor_2 = 11,  ///< K22/K12², mass 2 moving, drag-free on mass 1.
  no_target = 12,    ///< None: for estimation methods that do not go by targets.
};

inline constexpr std::size_t num_session_targets = 12;

/// 0 to 11.
[[nodiscard]] constexpr std::size_t index(SessionTarget target) {
  return static_cast<std::size_t>(target) - 1;
}

/// What a session may shake.
enum class ExcitationRule : std::uint8_t {
  none,      ///< Nothing.
  stimulus,  ///< The stimulus first, then anything.
  any,
};

/// What must be shaken for a target to show.
struct Stimulus {
  ExcitationKind kind = ExcitationKind::drag_free;
  Axis axis = Axis::x;
  MassMotion motion = MassMotion::opposition;
};

/// All that is particular to a target ([Hardy2013] section 4.2).
struct TargetInfo {
  SessionTarget target;
  std::string_view name;  ///< For files: `a_c11_delta_x`.
  ExcitationRule excitations;
  Stimulus stimulus;                        ///< Of ExcitationRule::stimulus.
  std::optional<DragFreeSource> drag_free;  ///< What the drag-free loop has to null; none: any.
  Signal regressor;                         ///< What Γ_mes,dx is fitted against, unless no_target.
  Product product;                          ///< What Signal::product is in the session.
  double scale;                             ///< The target is this times the slope of that fit.
  SignalSet signals;                        ///< What the correction of Γ_mes,dx needs.
};

/// @pre target is one of the enumerators.
[[nodiscard]] const TargetInfo& target_info(SessionTarget target);

/// Names for files: `a_c11_delta_x`.
[[nodiscard]] const char* name_of(SessionTarget target);

}  // namespace proofmass
