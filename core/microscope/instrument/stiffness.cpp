#include "core/microscope/instrument/stiffness.hpp"

#include <Eigen/LU>

namespace proofmass {

bool feels_stiffness(const SensorConfig& config, const Session& session) {
  const Excitation* const motion = mass_excitation(session);
  if (motion == nullptr || motion->axis == Axis::x) return false;
  return config.radial_stiffness_s2[0] != 0.0 || config.radial_stiffness_s2[1] != 0.0;
}

Eigen::Vector3d stiffness_direction_S(const Sensor& sensor, double stiffness_s2, Axis axis,
                                      double factor) {
  const Eigen::Vector3d measured =
      sensor.symmetric_part().col(static_cast<Eigen::Index>(index(axis)));
  return -factor * stiffness_s2 * (sensor.sensitivity_KS().inverse() * measured);
}

}  // namespace proofmass
