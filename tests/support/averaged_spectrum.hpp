#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <string>
#include <unsupported/Eigen/FFT>
#include <vector>

namespace proofmass::test {

/// The mean of one-sided periodograms under a Hann window, unit²/Hz, from records of equal length.
class AveragedSpectrum {
 public:
  AveragedSpectrum(std::size_t segment_length, double sample_period_s)
      : segment_length_(segment_length),
        sample_period_s_(sample_period_s),
        sum_(segment_length / 2, 0.0) {}

  /// @param record  segment_length samples; Σw² = 3n/8.
  void add(std::vector<double> record) {
    for (std::size_t k = 0; k < segment_length_; ++k) {
      const double turns = static_cast<double>(k) / static_cast<double>(segment_length_);
      record[k] *= 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * turns);
    }
    Eigen::FFT<double> fft;
    std::vector<std::complex<double>> transform;
    fft.fwd(transform, record);
    const double density = 2.0 * sample_period_s_ / (0.375 * static_cast<double>(segment_length_));
    for (std::size_t m = 0; m < sum_.size(); ++m) sum_[m] += density * std::norm(transform[m]);
    ++num_segments_;
  }

  /// Compares half-octave bands from bin 4, 1.5e-5 Hz times 4 for 18 hours, to `highest_hz` with a
  /// density.
  ///
  /// A periodogram's bin has the relative deviation 1; neighbours correlate by (2/3)² and the next
  /// by (1/6)² under the Hann window. The mean of K bins of M segments therefore has the standard
  /// error √((1 + 2·(4/9 + 1/36))/(K·M)). Five of them are allowed, and `model_tolerance` besides.
  template <typename Density>
  void expect(Density density, double highest_hz, double model_tolerance,
              const std::string& name) const {
    double first = 4.0;
    while (first * std::numbers::sqrt2 * bin_hz() < highest_hz) {
      const double last = first * std::numbers::sqrt2;
      const auto begin = static_cast<std::size_t>(std::ceil(first));
      const auto end = static_cast<std::size_t>(std::ceil(last));
      first = last;
      const auto count = static_cast<double>(end - begin);
      double ratio = 0.0;
      for (std::size_t m = begin; m < end; ++m) {
        ratio += sum_[m] / num_segments_ / windowed(density, m) / count;
      }
      const double error = std::sqrt((1.0 + 17.0 / 18.0) / (count * num_segments_));
      EXPECT_NEAR(ratio, 1.0, 5.0 * error + model_tolerance)
          << name << " from " << bin_hz() * static_cast<double>(begin) << " Hz";
    }
  }

 private:
  [[nodiscard]] double bin_hz() const {
    return 1.0 / (sample_period_s_ * static_cast<double>(segment_length_));
  }
  /// What a Hann window makes of a density: its neighbours count one sixth each.
  template <typename Density>
  [[nodiscard]] double windowed(Density density, std::size_t bin) const {
    const double f = bin_hz() * static_cast<double>(bin);
    return (density(f - bin_hz()) + 4.0 * density(f) + density(f + bin_hz())) / 6.0;
  }

  std::size_t segment_length_;
  double sample_period_s_;
  std::vector<double> sum_;
  int num_segments_ = 0;
};

}  // namespace proofmass::test
