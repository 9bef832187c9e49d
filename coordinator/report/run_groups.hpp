#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/campaign/run_result.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {

/// Splits results in run order into groups of one size: the runs of an instrument, or of a
/// replicate of a design. Group g has the runs from g·size on.
class RunGroups {
 public:
  explicit RunGroups(std::uint64_t size) : size_(size) { PROOFMASS_EXPECT(size_ > 1); }

  /// @return The runs of the group that this one completes, until the next call; else none.
  [[nodiscard]] std::span<const RunResult> add(const RunResult& run) {
    if (!runs_.empty() && number_of(runs_.front()) != number_of(run)) (void)incomplete();
    runs_.push_back(run);
    return runs_.size() < size_ ? std::span<const RunResult>() : runs_;
  }
  /// Numbers of the groups that lack a run. @pre Every result was added.
  [[nodiscard]] const std::vector<std::uint64_t>& incomplete() {
    const bool is_cut_short = !runs_.empty() && runs_.size() < size_;
    if (is_cut_short) incomplete_.push_back(number_of(runs_.front()));
    runs_.clear();
    return incomplete_;
  }

 private:
  [[nodiscard]] std::uint64_t number_of(const RunResult& run) const {
    return run.run.value / size_;
  }

  std::uint64_t size_;
  std::vector<RunResult> runs_;  ///< Of the last group.
  std::vector<std::uint64_t> incomplete_;
};

template <typename IsHit>
std::uint64_t count_of(std::span<const RunResult> runs, const IsHit& is_hit) {
  return static_cast<std::uint64_t>(std::ranges::count_if(runs, is_hit));
}

/// Whether a run without an estimate, or with a larger |error|, misses the objective of a quantity.
inline bool is_beyond(const RunResult& run, std::size_t quantity, double objective) {
  return !run.is_completed() || std::abs(run.error(quantity)) > objective;
}

}  // namespace proofmass::coordinator
