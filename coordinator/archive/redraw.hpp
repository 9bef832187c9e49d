#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::coordinator {

/// What drawing all runs of a file again finds.
struct Redraw {
  std::uint64_t num_drawn = 0;      ///< Runs that have a draw.
  std::uint64_t num_different = 0;  ///< Those of another draw.
  /// The first ones by run: `run 3: truth_a_c12_rad = 1 (must be 2)`.
  std::vector<std::string> differences;
};

/// Draws the instrument of each run again and compares its true parameters and the number of draws
/// with those that are stored, to the last bit; some 11 µs a run and thread. Runs without a draw
/// are left out: to find none takes a thousand draws. Memory does not grow with the runs.
///
/// @param campaign  The definition in the file.
/// @throws StoreError if the file cannot be read, Interrupted.
[[nodiscard]] Redraw redraw_runs(const Store& store, const Campaign& campaign,
                                 std::size_t num_threads, const IsStopped& is_stopped);

}  // namespace proofmass::coordinator
