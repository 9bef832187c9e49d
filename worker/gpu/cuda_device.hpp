#pragma once

#include <array>
#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/device.hpp"

namespace proofmass::worker {

/// What NVIDIA's driver says of a card.
struct CudaCard {
  int index = 0;     ///< The driver's number, from 0.
  std::string name;  ///< `NVIDIA H100 80GB HBM3 (CUDA 13.0)`: the version that its driver knows.
};

/// The cards of an option's value: `all`, or numbers such as `0,1`; none for `none`. The driver,
/// libcuda.so.1, is loaded when the first one is asked for: no program is linked with it.
/// @throws InvalidArgument reading `gpu = 7 (must be ...)`, or what is missing here.
[[nodiscard]] std::vector<CudaCard> cuda_cards_of(std::string_view text);

/// A launch takes 9 ms on an H100. As each processor of a card has the same number of runs, it
/// takes in proportion longer the fewer units for double precision a processor has: 0.3 s where
/// there are 2 of them, as in cards for games, instead of 64. This is 200 times as long, for cards
/// that several programs share.
inline constexpr std::chrono::milliseconds kernel_time_max = std::chrono::minutes(1);

/// A card as a Device. What is on it stays there until the process ends: a driver whose card hangs
/// would wait for that for ever if it were asked to release anything.
class CudaDevice : public Device {
 public:
  /// @param time_max  A kernel that takes longer hangs. Time in which the process is stopped does
  ///                  not count.
  /// @throws DeviceError
  explicit CudaDevice(const CudaCard& card, std::chrono::milliseconds time_max = kernel_time_max);
  CudaDevice(const CudaDevice&) = delete;
  CudaDevice& operator=(const CudaDevice&) = delete;

  void begin(const char* program) override;
  [[nodiscard]] std::size_t num_resident_blocks(const char* kernel, std::size_t num_threads,
                                                std::size_t shared_bytes) override;
  [[nodiscard]] std::size_t free_bytes() override;
  [[nodiscard]] void* allocate(std::size_t num_bytes) override;
  void copy_in(void* to, std::span<const std::byte> from) override;
  void copy_out(std::span<std::byte> to, const void* from) override;
  void launch(Queue queue, const Launch& launch) override;
  void wait(Mark mark) override;

 private:
  /// Of the driver's handles only their size matters here.
  using Handle = void*;

  void check(int result, const char* what) const;
  [[nodiscard]] Handle kernel(const char* name) const;

  int index_;
  std::chrono::milliseconds time_max_;
  int device_ = 0;
  Handle context_ = nullptr;
  Handle module_ = nullptr;
  Handle copies_ = nullptr;
  std::array<Handle, 2> queues_{};
  std::array<Handle, num_marks> marks_{};
  std::vector<void*> memory_;
};

}  // namespace proofmass::worker
