#pragma once

#include <string>
#include <vector>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/archive/replay.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/recording.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

/// Samples of a session that a spectrum is computed of: 24 days at 4 Hz, 0.4 GB while it is
/// computed. A longer session has none.
inline constexpr std::size_t num_spectrum_samples_max = std::size_t{1} << 23;

/// The spectra that the model describes of a run (Recording::spectra), from a replay of it.
///
/// A decade has 24 points; each bin within two of a fitted line has a point of its own. If the
/// replay differs from the stored result there are none, and the reasons say so.
/// @throws as Replay::run() and Replay::stored_result().
[[nodiscard]] RunSpectra replayed_spectra(const Replay& replay, RunIndex run,
                                          const IsStopped& is_stopped);

/// The spectra of the run that is the farthest off. None, and the reason, where there is no such
/// run or this program cannot replay it.
/// @param store  That of the review.
/// @throws StoreError; Interrupted.
[[nodiscard]] RunSpectra worst_run_spectra(const Store& store, const Review& review,
                                           const IsStopped& is_stopped);

/// `spectrum:SESSION` for each session that has a spectrum: the names of their charts.
[[nodiscard]] std::vector<std::string> spectrum_names(const Recording& recording);

}  // namespace proofmass::coordinator
