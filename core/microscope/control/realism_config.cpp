#include "core/microscope/control/realism_config.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

bool is_any_set(const std::array<double, 3>& numbers) {
  return std::ranges::any_of(numbers, [](double number) { return number != 0.0; });
}

}  // namespace

Eigen::Matrix3d RealismConfig::inertia_tensor_kg_m2() const {
  const auto& [xx, yy, zz] = inertia_kg_m2;
  const auto& [xy, xz, yz] = inertia_products_kg_m2;
  Eigen::Matrix3d tensor;
  tensor << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return tensor;
}

double RealismConfig::actuation_memory(double sample_period_s) const {
  if (actuation_lag_s == 0.0) return 0.0;
  constexpr double exponent_max = 50.0;  // Beyond, 1 less e^(−x) is 1.
  return exponential(-std::min(sample_period_s / actuation_lag_s, exponent_max));
}

void RealismConfig::validate() const {
  if (!has_inertia()) {
    if (is_any_set(inertia_kg_m2) || is_any_set(inertia_products_kg_m2) ||
        is_any_set(thrust_arm_m)) {
      throw ConfigError("realism.inertia_xx_kg_m2", "0",
                        "must be > 0 where another element or realism.thrust_arm is given");
    }
    return;
  }
  if (is_any_set(thrust_arm_m) && mass_kg == 0.0) {
    throw ConfigError("realism.mass_kg", "0", "must be > 0 where realism.thrust_arm is given");
  }
  const Eigen::Vector3d principal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia_tensor_kg_m2()).eigenvalues();
  if (principal[0] > 0.0 && principal[0] + principal[1] >= principal[2]) return;
  throw ConfigError("realism.inertia_xx_kg_m2", fmt::format("{}", inertia_kg_m2[0]),
                    fmt::format("with the other elements it must be a tensor of inertia: its "
                                "principal moments, {:.4g}, {:.4g} and {:.4g} kg m², must be > 0, "
                                "and none above the sum of the others",
                                principal[0], principal[1], principal[2]));
}

}  // namespace proofmass
