#include "coordinator/report/digest.hpp"

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

/// Appends the bytes of numbers.
class Layout {
 public:
  explicit Layout(std::vector<unsigned char>& bytes) : bytes_(bytes) { bytes_.clear(); }

  template <std::unsigned_integral Integer>
  void put(Integer value) {
    for (std::size_t i = 0; i < sizeof(value); ++i) {
      bytes_.push_back(static_cast<unsigned char>(value >> (8 * i)));
    }
  }

  // Adding zero takes the sign from a negative zero, which SQLite does not keep.
  void put(double value) { put(std::bit_cast<std::uint64_t>(value + 0.0)); }

  /// As many as there are; zeros where they mean nothing.
  void put(const std::vector<double>& values, bool have_meaning, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) put(have_meaning ? values[i] : 0.0);
  }

 private:
  std::vector<unsigned char>& bytes_;
};

}  // namespace

void Digest::add(const RunResult& result) {
  const std::size_t num_quantities = model().results().quantities.size();
  Layout layout(bytes_);
  layout.put(result.run.value);
  layout.put(static_cast<std::uint32_t>(result.status));
  layout.put(result.num_draws);
  layout.put(result.num_rounds);
  layout.put(std::uint32_t{0});
  layout.put(result.truth, result.has_truth(), num_quantities);
  layout.put(result.estimate, result.has_estimate(), num_quantities);
  layout.put(result.standard_error, true, result.standard_error.size());
  hash_.add(bytes_);

  if (result.health.empty()) return;
  has_health_ = true;
  Layout of_health(bytes_);
  of_health.put(result.run.value);
  of_health.put(result.health, true, result.health.size());
  const Loss loss = result.status == RunStatus::lost ? result.loss : Loss{};
  of_health.put(loss.cause);
  of_health.put(loss.session);
  health_hash_.add(bytes_);
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
