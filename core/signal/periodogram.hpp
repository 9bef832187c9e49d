#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace proofmass {

/// One-sided PSD of a record under a Hann window, at multiples of 1/duration_s.
///
/// Of white noise each bin has the mean 2σ²T and its own value as standard deviation; the window
/// correlates neighbours by 4/9 and the next but one by 1/36. A sine of amplitude A at a bin's
/// frequency reaches A²·duration_s/3 there and a quarter of it beside.
struct Periodogram {
  double duration_s = 0.0;  ///< Of the samples that were used.
  std::vector<double> psd;  ///< unit²/Hz; [m] is at m/duration_s, m up to half of the samples.
};

/// @param record  3 samples at least. Its mean is removed. The last samples are left out where that
///                makes the length a product of 2, 3 and 5.
[[nodiscard]] Periodogram hann_periodogram(std::span<const double> record, double sample_period_s);

/// The largest product of powers of 2, 3 and 5 that is not above a number.
/// @pre number ≥ 1.
[[nodiscard]] std::size_t transform_length(std::size_t number);

}  // namespace proofmass
