#include "core/microscope/results/health.hpp"

namespace proofmass {

const std::array<HealthValue, num_health_values>& health_values() {
  static const std::array<HealthValue, num_health_values> values{{
      {&LoopHealth::acceleration_m_s2, {"acceleration", "_m_s2", "m/s²"}},
      {&LoopHealth::attitude_rad, {"attitude", "_rad", "rad"}},
      {&LoopHealth::residual_m_s2, {"residual", "_m_s2", "m/s²"}},
      {&LoopHealth::quadratic_noise, {"quadratic_noise", "", "1"}},
      {&LoopHealth::square_noise, {"square_noise", "", "1"}},
  }};
  return values;
}

LoopHealth health_of(std::span<const double> values) {
  LoopHealth health;
  for (std::size_t i = 0; i < num_health_values; ++i) health.*health_values()[i].member = values[i];
  return health;
}

const HealthQuantity& test_residual_quantity() {
  static const HealthQuantity quantity{"test_residual", "_m_s2", "m/s²"};
  return quantity;
}

const std::array<HealthQuantity, 2>& margin_quantities() {
  static const std::array<HealthQuantity, 2> quantities{
      {{"gain_margin", "", "1"}, {"phase_margin", "_rad", "rad"}}};
  return quantities;
}

std::string_view name_of(LossCause cause) {
  static constexpr std::array<std::string_view, num_loss_causes + 1> names{
      "none", "saturation", "attitude", "residual", "quadratic_noise", "square_noise"};
  return names.at(static_cast<std::size_t>(cause));
}

}  // namespace proofmass
