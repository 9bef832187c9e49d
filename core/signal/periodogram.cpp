#include "core/signal/periodogram.hpp"

#include <algorithm>
#include <complex>
#include <numeric>
#include <unsupported/Eigen/FFT>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

std::vector<double> windowed(std::span<const double> record) {
  const auto count = static_cast<double>(record.size());
  const double mean = std::accumulate(record.begin(), record.end(), 0.0) / count;
  std::vector<double> samples;
  samples.reserve(record.size());
  for (const double value : record) {
    const double turns = static_cast<double>(samples.size()) / count;
    const double window = 0.5 - 0.5 * sincos_turns(turns).cosine;
    samples.push_back(window * (value - mean));
  }
  return samples;
}

}  // namespace

std::size_t transform_length(std::size_t number) {
  std::size_t largest = 1;
  for (std::size_t fives = 1; fives <= number; fives *= 5) {
    for (std::size_t length = fives; length <= number; length *= 3) {
      std::size_t doubled = length;
      while (doubled <= number / 2) doubled *= 2;
      largest = std::max(largest, doubled);
    }
  }
  return largest;
}

Periodogram hann_periodogram(std::span<const double> record, double sample_period_s) {
  const std::size_t length = transform_length(record.size());
  const std::vector<double> samples = windowed(record.first(length));
  Eigen::FFT<double> transform;
  transform.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<std::complex<double>> bins;
  transform.fwd(bins, samples);
  Periodogram periodogram;
  periodogram.duration_s = static_cast<double>(length) * sample_period_s;
  // The squares of the window add up to three eighths of the length.
  const double density = 2.0 * sample_period_s / (0.375 * static_cast<double>(length));
  for (const std::complex<double>& bin : bins) {
    periodogram.psd.push_back(density * std::norm(bin));
  }
  return periodogram;
}

}  // namespace proofmass
