#pragma once

#include <Eigen/Core>

#include "core/math/vector3.hpp"

namespace proofmass {

// From what a run is set up with to what the sample loop is written in.

[[nodiscard]] inline Vector3<double> vector3(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

[[nodiscard]] inline Matrix3<double> matrix3(const Eigen::Matrix3d& m) {
  return {{vector3(m.row(0)), vector3(m.row(1)), vector3(m.row(2))}};
}

}  // namespace proofmass
