#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/campaign/device.hpp"

namespace proofmass::worker {

struct CudaFunctions;

/// What NVIDIA's driver says of a card.
struct CudaCard {
  int index = 0;       ///< The driver's number, from 0.
  std::string name;    ///< `NVIDIA H100 80GB HBM3`.
  std::string driver;  ///< The CUDA version that the driver knows: `13.0`.
};

/// The cards of an option's value: `all`, or numbers such as `0,1`; none for `none`. The driver,
/// libcuda.so.1, is loaded when the first one is asked for: no program is linked with it.
/// @throws InvalidArgument reading `gpu = 7 (must be ...)`, or what is missing here.
[[nodiscard]] std::vector<CudaCard> cuda_cards_of(std::string_view text);

/// A card as a Device. Everything on it is released with this object.
class CudaDevice final : public Device {
 public:
  /// @throws DeviceError
  explicit CudaDevice(const CudaCard& card);
  ~CudaDevice() override;
  CudaDevice(const CudaDevice&) = delete;
  CudaDevice& operator=(const CudaDevice&) = delete;

  void load(std::string_view program) override;
  [[nodiscard]] std::size_t num_resident_blocks(std::string_view kernel, std::size_t num_threads,
                                                std::size_t shared_bytes) override;
  [[nodiscard]] std::size_t free_bytes() override;
  [[nodiscard]] Address allocate(std::size_t num_bytes) override;
  void release_all() override;
  void copy_in(Address to, std::span<const std::byte> from) override;
  void copy_out(std::span<std::byte> to, Address from) override;
  void launch(Queue queue, const Launch& launch) override;
  void set(Mark mark, Queue queue) override;
  void wait_in(Queue queue, Mark mark) override;
  void wait(Mark mark) override;

 private:
  /// Of the driver's handles only their size matters here.
  using Handle = void*;

  void check(int result, const char* what) const;
  [[nodiscard]] Handle kernel(std::string_view name);
  void make_current() const;

  const CudaFunctions& cuda_;
  CudaCard card_;
  int device_ = 0;
  Handle context_ = nullptr;
  Handle module_ = nullptr;
  Handle copies_ = nullptr;
  std::array<Handle, 2> queues_{};
  std::array<Handle, num_marks> marks_{};
  std::map<std::string, Handle, std::less<>> kernels_;
  std::vector<Address> memory_;
};

}  // namespace proofmass::worker
