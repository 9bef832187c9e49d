#pragma once

#include <cstdint>
#include <string>

#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator {

/// Runs that have no estimate, by reason: statistics leave them out, and say so.
struct MissingEstimates {
  std::uint64_t num_not_finite = 0;
  std::uint64_t num_no_draw = 0;
  std::uint64_t num_lost = 0;
  std::uint64_t num_given_up = 0;  ///< Having crashed workers: without a result.

  /// Counts a result if it has no estimate.
  void add(const RunResult& result);
  [[nodiscard]] std::uint64_t total() const;

  bool operator==(const MissingEstimates&) const = default;
};

/// `2 not finite, 1 without draw`, at most 76 characters; empty if there are none.
[[nodiscard]] std::string reasons_text(const MissingEstimates& missing);

}  // namespace proofmass::coordinator
