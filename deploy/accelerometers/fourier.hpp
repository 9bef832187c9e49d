#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "core/math/complex.hpp"

namespace proofmass {

/// The discrete Fourier transform of records whose length has no prime factor above 5. A day of
/// seconds has none. Additions and products alone, in a fixed order: the same bits everywhere.
class FourierTransform {
 public:
  /// True if a record of so many samples can be transformed: even, at least 2.
  [[nodiscard]] static bool can(std::size_t num_samples);

  /// @pre can(num_samples).
  explicit FourierTransform(std::size_t num_samples);

  [[nodiscard]] std::size_t size() const { return twiddles_.size(); }
  /// Bins with a frequency above 0 and below half the sample rate: k = 1 ... num_bins().
  [[nodiscard]] std::size_t num_bins() const { return size() / 2 - 1; }

  /// Xₖ = Σ xⱼ e^(−2πi jk/n) of two real records, shape [num_bins()], bin k at k − 1.
  [[nodiscard]] std::pair<std::vector<ComplexDouble>, std::vector<ComplexDouble>> spectra(
      std::span<const double> first, std::span<const double> second) const;

  /// Two real records xⱼ = Re Σ aₖ e^(2πi jk/n) of amplitudes aₖ, shape [num_bins()].
  [[nodiscard]] std::pair<std::vector<double>, std::vector<double>> records(
      std::span<const ComplexDouble> first, std::span<const ComplexDouble> second) const;

 private:
  void transform(const ComplexDouble* input, std::size_t stride, ComplexDouble* output,
                 std::size_t size) const;

  std::vector<ComplexDouble> twiddles_;  ///< e^(−2πi k/n).
};

}  // namespace proofmass
