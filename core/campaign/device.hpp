#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass {

/// A device failed, or lacks what is asked of it. What it computed counts for nothing.
class DeviceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An accelerator with memory and queues of kernels of its own, as far as a simulation needs one.
/// One thread uses it. Every function throws DeviceError if the device fails.
class Device {
 public:
  virtual ~Device() = default;

  /// Makes the device ready for a program: releases all memory once no kernel runs any more.
  /// @param program  Its kernels in PTX, the same at every call.
  virtual void begin(const char* program) = 0;

  /// Blocks of a kernel that are computed at the same time.
  [[nodiscard]] virtual std::size_t num_resident_blocks(const char* kernel, std::size_t num_threads,
                                                        std::size_t shared_bytes) = 0;
  /// Memory that nobody uses, bytes.
  [[nodiscard]] virtual std::size_t free_bytes() = 0;

  /// Memory of the device, until begin() is called again.
  [[nodiscard]] virtual void* allocate(std::size_t num_bytes) = 0;

  /// Copy at once, beside the kernels that run.
  virtual void copy_in(void* to, std::span<const std::byte> from) = 0;
  virtual void copy_out(std::span<std::byte> to, const void* from) = 0;

  /// Which of two queues a kernel waits in; each runs its kernels one after the other. Where both
  /// have one, blocks of that in the second queue begin first.
  enum class Queue : std::uint8_t { first, second };

  /// Which kernel others wait for: the last one that was launched with this mark, if there is one.
  using Mark = std::size_t;
  static constexpr Mark num_marks = 4;

  struct Launch {
    const char* kernel = nullptr;
    std::size_t num_blocks = 0;
    std::size_t num_blocks_y = 1;
    std::size_t num_threads = 0;       ///< Of a block.
    std::size_t shared_bytes = 0;      ///< Of a block.
    std::span<void* const> arguments;  ///< Pointers to the kernel's arguments.
    Mark after = 0;                    ///< The kernel begins after that one has ended.
    Mark mark = 0;                     ///< Its own.
  };
  virtual void launch(Queue queue, const Launch& launch) = 0;

  /// Waits until the kernel has ended.
  /// @throws DeviceError also if it has not within a time that no kernel takes: the device hangs.
  virtual void wait(Mark mark) = 0;
};

/// Runs of a campaign in flight on a device.
class DeviceSimulation {
 public:
  virtual ~DeviceSimulation() = default;

  /// Runs that are best added together.
  static constexpr std::size_t group_size = 128;
  /// Runs that keep the device busy: so many are best in flight.
  [[nodiscard]] virtual std::size_t capacity() const = 0;
  [[nodiscard]] virtual std::size_t num_in_flight() const = 0;

  /// @param group     A number for these runs that no others in flight have.
  /// @param requests  At least one, at most group_size.
  virtual void add(std::uint64_t group, std::span<const RunRequest> requests) = 0;
  /// Steps that each run of a group in flight has done, as Plan::num_steps() counts them.
  [[nodiscard]] virtual int num_steps_done(std::uint64_t group) const = 0;

  struct Ended {
    std::uint64_t group = 0;
    std::vector<RunResult> results;  ///< The same bits as of Plan::simulate_batch(), in its order.
  };
  /// Goes on for some milliseconds.
  /// @return The groups that ended.
  [[nodiscard]] virtual std::vector<Ended> advance() = 0;
};

}  // namespace proofmass
