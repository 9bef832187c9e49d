#include "coordinator/report/digest.hpp"

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace proofmass::coordinator {
namespace {

constexpr std::size_t result_size = 8 + 4 * 4 + 2 * num_parameters * 8;
constexpr std::size_t health_size = 8 + 5 * 8 + 2 * 4;

/// Writes numbers one after the other into the bytes of a result.
template <std::size_t num_bytes>
class Layout {
 public:
  template <std::unsigned_integral Integer>
  void put(Integer value) {
    for (std::size_t i = 0; i < sizeof(value); ++i) {
      bytes_[size_++] = static_cast<unsigned char>(value >> (8 * i));
    }
  }

  // Adding zero takes the sign from a negative zero, which SQLite does not keep.
  void put(double value) { put(std::bit_cast<std::uint64_t>(value + 0.0)); }

  void put(const ParameterArray& values) {
    for (const double value : values) put(value);
  }

  [[nodiscard]] std::span<const unsigned char> bytes() const { return bytes_; }

 private:
  std::array<unsigned char, num_bytes> bytes_{};
  std::size_t size_ = 0;
};

}  // namespace

void Digest::add(const RunResult& result) {
  Layout<result_size> layout;
  layout.put(result.run.value);
  layout.put(static_cast<std::uint32_t>(result.status));
  layout.put(result.num_draws);
  layout.put(result.num_rounds);
  layout.put(std::uint32_t{0});
  layout.put(result.has_truth() ? result.truth : ParameterArray{});
  layout.put(result.has_estimate() ? result.estimate : ParameterArray{});
  hash_.add(layout.bytes());
  if (!result.health) return;
  has_health_ = true;
  Layout<health_size> of_health;
  of_health.put(result.run.value);
  for (const HealthValue& value : health_values()) of_health.put((*result.health).*value.member);
  const bool is_lost = result.status == RunStatus::lost;
  of_health.put(static_cast<std::uint32_t>(result.loss.cause));
  of_health.put(is_lost ? static_cast<std::uint32_t>(result.loss.session) : std::uint32_t{0});
  health_hash_.add(of_health.bytes());
}

ResultDigests Digest::finish() {
  ResultDigests digests{.results = hash_.finish(), .health = {}};
  if (has_health_) digests.health = health_hash_.finish();
  return digests;
}

std::string digest_of(const Store& store) {
  Digest digest;
  store.for_each_result([&](const RunResult& result) { digest.add(result); });
  return digest.finish().results;
}

}  // namespace proofmass::coordinator
