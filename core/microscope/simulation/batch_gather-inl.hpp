#pragma once

// What the lanes of a kernel begin with; see batch_kernel-inl.hpp.

#include <cstddef>
#include <span>

#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/loop.hpp"

namespace proofmass {
namespace {

/// Gathers one number of each lane.
template <typename Get>
HWY_INLINE Batch gather(const Get& get) {
  alignas(64) double values[num_lanes];
  for (std::size_t lane = 0; lane < num_lanes; ++lane) values[lane] = get(lane);
  return load(values);
}

template <typename Get>
HWY_INLINE Vector3<Batch> gather_vector(const Get& get) {
  return {gather([&](std::size_t lane) { return get(lane).x; }),
          gather([&](std::size_t lane) { return get(lane).y; }),
          gather([&](std::size_t lane) { return get(lane).z; })};
}

template <typename Get>
HWY_INLINE Matrix3<Batch> gather_matrix(const Get& get) {
  return {{{gather_vector([&](std::size_t lane) { return get(lane).row[0]; }),
            gather_vector([&](std::size_t lane) { return get(lane).row[1]; }),
            gather_vector([&](std::size_t lane) { return get(lane).row[2]; })}}};
}

using ConstantsOfLanes = std::span<const LoopConstants<double>, num_lanes>;

HWY_INLINE SensorModel<Batch> gather_sensor(ConstantsOfLanes constants, std::size_t k) {
  const auto sensor = [&](std::size_t lane) -> const SensorModel<double>& {
    return constants[lane].sensors[k];
  };
  return {gather_vector([&](std::size_t lane) { return sensor(lane).rest_position_S_m; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).motion_direction_S; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).second_direction_S; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).parasitic_K_m_s2; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).offset_K_m_s2; }),
          gather_matrix([&](std::size_t lane) { return sensor(lane).sensitivity_KS; }),
          gather_vector([&](std::size_t lane) { return sensor(lane).quadratic_s2_m; })};
}

HWY_INLINE LoopConstants<Batch> gather_constants(ConstantsOfLanes of) {
  return {{gather_sensor(of, 0), gather_sensor(of, 1)},
          {gather([&](std::size_t lane) { return of[lane].drag_free_weight[0]; }),
           gather([&](std::size_t lane) { return of[lane].drag_free_weight[1]; })},
          gather_vector([&](std::size_t lane) { return of[lane].subtracted_bias_S_m_s2; }),
          gather_matrix([&](std::size_t lane) { return of[lane].thrust_matrix; }),
          gather_vector([&](std::size_t lane) { return of[lane].angular_bias_S_rad_s2; }),
          gather_vector([&](std::size_t lane) { return of[lane].star_tracker_bias_S_rad; }),
          of[0].sensor_range_m_s2};
}

}  // namespace
}  // namespace proofmass
