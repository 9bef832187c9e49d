#include "core/microscope/results/health.hpp"

#include "core/error.hpp"

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

const std::array<HealthQuantity, 2>& margin_quantities() {
  static const std::array<HealthQuantity, 2> quantities{
      {{"gain_margin", "", "1"}, {"phase_margin", "_rad", "rad"}}};
  return quantities;
}

std::string_view name_of(LossCause cause) {
  switch (cause) {
    case LossCause::none:
      return "none";
    case LossCause::saturation:
      return "saturation";
    case LossCause::attitude:
      return "attitude";
    case LossCause::residual:
      return "residual";
    case LossCause::quadratic_noise:
      return "quadratic_noise";
    case LossCause::square_noise:
      return "square_noise";
  }
  PROOFMASS_EXPECT(false);
  return {};
}

}  // namespace proofmass
