#pragma once

// Numbers of the lanes of a kernel, in and out; see batch_kernel-inl.hpp.

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>

#include "core/microscope/simulation/batch-inl.hpp"
#include "core/microscope/simulation/loop.hpp"

namespace proofmass {
namespace {

// Types over Batch consist of the numbers of the same type over double, in the same order.

template <typename OfBatch, typename OfDouble>
constexpr bool are_alike = std::is_trivially_copyable_v<OfDouble> &&
                           sizeof(OfBatch) / sizeof(Batch) == sizeof(OfDouble) / sizeof(double);

/// Sets a lane's first `count` numbers.
template <typename OfBatch, typename OfDouble>
HWY_INLINE void put_lane(OfBatch& group, const OfDouble& one, std::size_t lane,
                         std::size_t count = sizeof(OfDouble) / sizeof(double)) {
  static_assert(are_alike<OfBatch, OfDouble>);
  auto* const to = reinterpret_cast<std::byte*>(&group) + lane * sizeof(double);
  const auto* const from = reinterpret_cast<const std::byte*>(&one);
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(to + i * sizeof(Batch), from + i * sizeof(double), sizeof(double));
  }
}

/// The numbers of a lane.
template <typename OfDouble, typename OfBatch>
HWY_INLINE OfDouble lane_of(const OfBatch& group, std::size_t lane) {
  static_assert(are_alike<OfBatch, OfDouble>);
  OfDouble one;
  auto* const to = reinterpret_cast<std::byte*>(&one);
  const auto* const from = reinterpret_cast<const std::byte*>(&group) + lane * sizeof(double);
  for (std::size_t i = 0; i < sizeof(OfDouble) / sizeof(double); ++i) {
    std::memcpy(to + i * sizeof(double), from + i * sizeof(Batch), sizeof(double));
  }
  return one;
}

using ConstantsOfLanes = std::span<const LoopConstants<double>, num_lanes>;

HWY_INLINE LoopConstants<Batch> gather_constants(ConstantsOfLanes of) {
  LoopConstants<Batch> gathered;
  for (std::size_t lane = 0; lane < num_lanes; ++lane) {
    const LoopConstants<double>& one = of[lane];
    put_lane(gathered.sensors, one.sensors, lane);
    put_lane(gathered.drag_free_weight, one.drag_free_weight, lane);
    put_lane(gathered.subtracted_bias_S_m_s2, one.subtracted_bias_S_m_s2, lane);
    put_lane(gathered.thrust_matrix, one.thrust_matrix, lane);
    put_lane(gathered.angular_bias_S_rad_s2, one.angular_bias_S_rad_s2, lane);
    put_lane(gathered.star_tracker_bias_S_rad, one.star_tracker_bias_S_rad, lane);
  }
  gathered.sensor_range_m_s2 = of[0].sensor_range_m_s2;
  return gathered;
}

}  // namespace
}  // namespace proofmass
