#include "coordinator/report/digest.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace proofmass::coordinator {
namespace {

constexpr std::size_t result_size = 8 + 4 * 4 + 2 * num_parameters * 8;

/// Writes numbers one after the other into the bytes of a result.
class Layout {
 public:
  template <typename Integer>
  void put(Integer value) {
    for (std::size_t i = 0; i < sizeof(value); ++i) {
      bytes_[size_++] = static_cast<unsigned char>(value >> (8 * i));
    }
  }

  void put(const ParameterArray& values) {
    // Adding zero takes the sign from a negative zero, which SQLite does not keep.
    for (const double value : values) put(std::bit_cast<std::uint64_t>(value + 0.0));
  }

  [[nodiscard]] std::span<const unsigned char> bytes() const { return bytes_; }

 private:
  std::array<unsigned char, result_size> bytes_{};
  std::size_t size_ = 0;
};

}  // namespace

void Digest::add(const RunResult& result) {
  Layout layout;
  layout.put(result.run.value);
  layout.put(static_cast<std::uint32_t>(result.status));
  layout.put(result.num_draws);
  layout.put(result.num_rounds);
  layout.put(std::uint32_t{0});
  layout.put(result.has_truth() ? result.truth : ParameterArray{});
  layout.put(result.has_estimate() ? result.estimate : ParameterArray{});
  hash_.add(layout.bytes());
}

std::string Digest::finish() { return hash_.finish(); }

std::string digest_of(const Store& store) {
  Digest digest;
  store.for_each_result([&](const RunResult& result) { digest.add(result); });
  return digest.finish();
}

}  // namespace proofmass::coordinator
