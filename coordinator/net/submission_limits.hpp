#pragma once

#include <cstddef>
#include <cstdint>

namespace proofmass::coordinator {

/// What one key may have submitted and not finished.
struct SubmissionLimits {
  std::size_t campaigns_max = 100;
  std::uint64_t size_max = std::uint64_t{1} << 30;  ///< Of their definitions, bytes.
};

}  // namespace proofmass::coordinator
