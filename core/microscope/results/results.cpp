#include "core/microscope/results/results.hpp"

#include "core/microscope/results/health.hpp"
#include "core/microscope/session/session.hpp"

namespace proofmass {
namespace {

// [Hardy2013] tab:perfo-numerical: objective, then worst / mean / standard deviation.
std::vector<Quantity> parameters() {
  using P = PublishedAccuracy;
  // clang-format off
  return {
      {"a_c11_delta_x", "_m", "a_c11·Δx", "m", 1e-9, "nm", 0.1e-6, P{0.04e-6, 0.01e-6, 7.3e-9}},
      {"a_c11_delta_z", "_m", "a_c11·Δz", "m", 1e-9, "nm", 0.1e-6, P{0.05e-6, 0.03e-6, 6.5e-9}},
      {"a_c11_delta_y", "_m", "a_c11·Δy", "m", 1e-9, "nm", 2e-6, P{0.2e-6, 0.05e-6, 0.04e-6}},
      {"a_c12", "_rad", "a_c12", "rad", 1e-4, "1e-4 rad", 9e-4, P{1.0e-3, 2.6e-4, 2.3e-4}},
      {"a_c13", "_rad", "a_c13", "rad", 1e-4, "1e-4 rad", 9e-4, P{1.1e-3, 3.1e-4, 2.6e-4}},
      {"a_d11_prime", "", "a_d11'", "1", 1e-6, "1e-6", 1.5e-4, P{5e-6, 1.6e-6, 1.2e-6}},
      {"a_d12", "_rad", "a_d12", "rad", 1e-6, "1e-6 rad", 5e-5, P{2e-5, 1.2e-6, 1.7e-6}},
      {"a_d13", "_rad", "a_d13", "rad", 1e-6, "1e-6 rad", 5e-5, P{4e-6, 1.0e-6, 8.3e-7}},
      {"k2d", "_s2_m", "K2d/K1c²", "s²/m", 1.0, "s²/m", 250.0, P{124, 25, 23}},
      {"k2c", "_s2_m", "K2c/K1c²", "s²/m", 1.0, "s²/m", 1000.0, P{274, 62, 54}},
  };
  // clang-format on
}

std::vector<HealthQuantity> health_quantities() {
  std::vector<HealthQuantity> quantities;
  for (const HealthValue& value : health_values()) quantities.push_back(value.quantity);
  return quantities;
}

std::vector<std::string_view> loss_causes() {
  std::vector<std::string_view> names;
  for (std::size_t cause = 1; cause <= num_loss_causes; ++cause) {
    names.push_back(name_of(static_cast<LossCause>(cause)));
  }
  return names;
}

ResultSchema make_schema() {
  const auto targets = names_of(SessionTarget{});
  return {.quantities = parameters(),
          .health = health_quantities(),
          .loss_causes = loss_causes(),
          .loss_sessions = {targets.begin(), targets.end()},
          .num_draws_max = num_draws_max,
          .published_source = "Hardy et al. 2013"};
}

}  // namespace

const std::array<Quantity, num_test_parameters>& test_quantities() {
  static const std::array<Quantity, num_test_parameters> quantities{{
      {"eotvos_parameter", "", "δ", "1", 1e-15, "1e-15", 1e-15, {}, true},
      {"test_a_c11_delta_x", "_m", "Δx, test", "m", 1e-9, "nm", 0.1e-6},
      {"test_a_c11_delta_z", "_m", "Δz, test", "m", 1e-9, "nm", 0.1e-6},
      {"eotvos_parameter_uncorrected", "", "δ, raw", "1", 1e-15, "1e-15"},
  }};
  return quantities;
}

const ResultSchema& microscope_results() {
  static const ResultSchema schema = make_schema();
  return schema;
}

}  // namespace proofmass
