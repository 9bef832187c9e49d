#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/campaign/run_result.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {

/// How well the loops held the satellite and the sensors in a run; the largest over its sessions.
/// No number is beyond magnitude_max of a RunResult.
struct LoopHealth {
  /// Largest measured acceleration of a sensor along an axis before the sensor's range cuts it off,
  /// |Γ_mes,k|, m/s².
  double acceleration_m_s2 = 0.0;
  /// Largest angle about an axis that the attitude loop has to remove, rad.
  double attitude_rad = 0.0;
  /// Largest amplitude of Γ_mes,c along an axis at f_EP in the sessions without excitation, m/s².
  double residual_m_s2 = 0.0;
  /// Noise of the quadratic terms of Γ_mes,dx in those sessions, over that which the sensors have
  /// at the quietest line of a session; a ratio of densities of power.
  double quadratic_noise = 0.0;
  /// Noise of the squared measurement over its line, in power, in a session that finds a quadratic
  /// factor. The part of it in the line's phase scales the estimate of that factor by 1 + x, where
  /// x has the variance of half this number.
  double square_noise = 0.0;

  bool operator==(const LoopHealth&) const = default;
};

/// One of the numbers of a LoopHealth.
struct HealthValue {
  double LoopHealth::*member;
  HealthQuantity quantity;
};

inline constexpr std::size_t num_health_values = 5;

/// The health that a RunResult holds.
/// @param values  num_health_values of them, or more.
[[nodiscard]] LoopHealth health_of(std::span<const double> values);

/// All of them, in the order of LoopHealth.
[[nodiscard]] const std::array<HealthValue, num_health_values>& health_values();

/// What a RunResult holds of loops that are not the paper's, behind its LoopHealth: the least
/// Margins of the satellite that was drawn.
[[nodiscard]] const std::array<HealthQuantity, 2>& margin_quantities();

/// What a RunResult holds of sessions that test, behind all that: `residual` of these.
[[nodiscard]] const HealthQuantity& test_residual_quantity();

/// Why a run is lost: a sensor reached the end of its range, or something may have moved an
/// estimate by more than its objective (ShiftBounds). The values are stored and sent: never
/// renumber.
enum class LossCause : std::uint8_t {
  none = 0,
  saturation = 1,       ///< A sensor's range.
  attitude = 2,         ///< A large angle, or the rate at which the satellite spins.
  residual = 3,         ///< What the drag-free loop leaves.
  quadratic_noise = 4,  ///< Noise that the quadratic factors make.
  square_noise = 5,     ///< Noise of the squared measurement.
};

inline constexpr std::size_t num_loss_causes = 5;

/// `saturation`, for people and files.
[[nodiscard]] std::string_view name_of(LossCause cause);

/// Why a run is lost, and in which session: the first that saturated a sensor, or the one that
/// finds the parameter whose estimate was moved.
struct LoopLoss {
  LossCause cause = LossCause::none;
  SessionTarget session = SessionTarget::a_c11_delta_x;  ///< Meaningful unless cause is none.
};

}  // namespace proofmass
