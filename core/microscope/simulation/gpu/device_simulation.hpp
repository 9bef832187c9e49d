#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "core/campaign/device.hpp"
#include "core/microscope/simulation/gpu/lanes.hpp"
#include "core/microscope/simulation/run.hpp"
#include "core/microscope/simulation/run_parts.hpp"

namespace proofmass::gpu {

/// RunPlan::simulate_batch() for thousands of runs on a device.
///
/// Runs come in groups of group_lanes. Each session of a group is a group of lanes, which has a
/// slot of the device's memory from its first sample to its last. A launch advances as many slots
/// as the device computes at a time by launch_samples; while it runs, the host takes the sums of
/// the sessions that ended in the one before, and gives their slots to the longest that wait. So
/// short ones are left for the end, when no more runs come and every slot shall end at once.
class MicroscopeDeviceSimulation final : public DeviceSimulation {
 public:
  /// @pre can_simulate(parts).
  /// @param plan, parts  Outlive this object.
  MicroscopeDeviceSimulation(const RunPlan& plan, const RunParts& parts, Device& device);

  // The short sessions of so many runs take as long as the longest session of the last ones.
  [[nodiscard]] std::size_t capacity() const override { return num_at_once_ * group_lanes / 2; }
  [[nodiscard]] std::size_t num_in_flight() const override { return num_in_flight_; }
  void add(std::uint64_t group, std::span<const RunRequest> requests) override;
  [[nodiscard]] int num_steps_done(std::uint64_t group) const override;
  [[nodiscard]] std::vector<Ended> advance() override;

 private:
  struct RunGroup {
    std::vector<RunRecord> records;       ///< Of all requests, in their order.
    std::vector<Instrument> instruments;  ///< Of each lane.
    std::vector<std::size_t> record_of;   ///< Of each lane.
    std::uint64_t num_samples_done = 0;   ///< Of all sessions.
    std::size_t num_sessions_left = 0;    ///< None if no draw was accepted.
  };
  struct Slot {
    RunGroup* group = nullptr;  ///< Null while it is free.
    std::size_t session = 0;
    std::uint64_t next = 0;  ///< The first sample that no launch has.
  };

  void make_tables();
  void make_memory();
  void begin_session(std::uint32_t slot);
  void add_portion(std::uint32_t slot, std::vector<Portion>& portions);
  void launch();
  void end_session(std::uint32_t slot);
  [[nodiscard]] std::vector<Ended> take_ended();

  const RunPlan& plan_;
  const RunParts& parts_;
  Device& device_;
  std::vector<std::uint64_t> num_samples_;  ///< Of each session, settling included.
  std::vector<NoiseStreams> starts_;        ///< Of each session.
  Shared shared_{};
  const SessionTable* tables_ = nullptr;
  std::size_t num_at_once_ = 0;  ///< Slots of a launch.
  GroupMemory memory_{};
  std::array<std::byte*, 2> noise_{};   ///< Of every second launch.
  std::array<Portion*, 2> portions_{};  ///< Of every second launch.

  std::vector<Slot> slots_;
  /// Sessions without a slot, by their length.
  std::multimap<std::uint64_t, Slot, std::greater<>> waiting_;
  std::size_t num_in_flight_ = 0;
  std::size_t num_launches_ = 0;
  std::vector<std::uint32_t> ending_;         ///< Slots whose sessions end in the launch that runs.
  std::map<std::uint64_t, RunGroup> groups_;  ///< In flight, by number.
};

/// The kernels in PTX; empty if this build has none.
[[nodiscard]] const char* program();

/// Whether the kernels compute what a campaign needs; otherwise its runs are left to processors.
[[nodiscard]] bool can_simulate(const RunParts& parts);

}  // namespace proofmass::gpu
