#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace proofmass::coordinator {

/// A comparison that SQL makes with a run index.
enum class RunComparison : std::uint8_t { equal, above, at_least, below, at_most };

/// The rows of draw() that a statement wants: at least those, as SQLite looks at each row again.
struct DrawScan {
  std::uint64_t first_run = 0;
  std::uint64_t end_run = 0;            ///< One behind the last.
  std::optional<std::size_t> quantity;  ///< Index into Model::drawn(); empty for all.

  /// Leaves out runs that cannot hold `run_index <comparison> bound`.
  void narrow(RunComparison comparison, std::int64_t bound);
  void narrow(RunComparison comparison, double bound);
  void leave_none() { end_run = first_run; }
};

}  // namespace proofmass::coordinator
