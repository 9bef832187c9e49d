#include "fourier.hpp"

#include <array>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

/// The smallest of 2, 3 and 5 that divides a size; 0 if none does.
std::size_t factor_of(std::size_t size) {
  for (const std::size_t factor : {2U, 3U, 5U}) {
    if (size % factor == 0) return factor;
  }
  return 0;
}

}  // namespace

bool FourierTransform::can(std::size_t num_samples) {
  if (num_samples < 2 || num_samples % 2 != 0) return false;
  while (num_samples > 1) {
    const std::size_t factor = factor_of(num_samples);
    if (factor == 0) return false;
    num_samples /= factor;
  }
  return true;
}

FourierTransform::FourierTransform(std::size_t num_samples) {
  PROOFMASS_EXPECT(can(num_samples));
  for (std::size_t k = 0; k < num_samples; ++k) {
    const SineCosine turn = sincos_turns(static_cast<double>(k) / static_cast<double>(num_samples));
    twiddles_.emplace_back(turn.cosine, -turn.sine);
  }
}

/// Decimation in time: the transforms of every p-th sample, joined by p-point transforms.
void FourierTransform::transform(const ComplexDouble* input, std::size_t stride,
                                 ComplexDouble* output, std::size_t size) const {
  if (size == 1) {
    output[0] = input[0];
    return;
  }
  const std::size_t factor = factor_of(size), part = size / factor;
  for (std::size_t i = 0; i < factor; ++i) {
    transform(input + i * stride, stride * factor, output + i * part, part);
  }
  for (std::size_t k = 0; k < part; ++k) {
    std::array<ComplexDouble, 5> turned;
    for (std::size_t i = 0; i < factor; ++i) {
      turned[i] = i == 0 ? output[k] : twiddles_[i * k * stride] * output[i * part + k];
    }
    for (std::size_t j = 0; j < factor; ++j) {
      ComplexDouble sum = turned[0];
      for (std::size_t i = 1; i < factor; ++i) {
        sum += twiddles_[i * j % factor * part * stride] * turned[i];
      }
      output[j * part + k] = sum;
    }
  }
}

std::pair<std::vector<ComplexDouble>, std::vector<ComplexDouble>> FourierTransform::spectra(
    std::span<const double> first, std::span<const double> second) const {
  std::vector<ComplexDouble> both(size()), transformed(size());
  for (std::size_t j = 0; j < size(); ++j) both[j] = {first[j], second[j]};
  transform(both.data(), 1, transformed.data(), size());
  std::pair<std::vector<ComplexDouble>, std::vector<ComplexDouble>> spectra;
  for (std::size_t k = 1; k <= num_bins(); ++k) {
    // A real record's transform at −k is the conjugate of that at k.
    const ComplexDouble at = transformed[k], mirrored = conjugate(transformed[size() - k]);
    const ComplexDouble sum = 0.5 * (at + mirrored), difference = 0.5 * (at - mirrored);
    spectra.first.push_back(sum);
    spectra.second.emplace_back(difference.imag(), -difference.real());
  }
  return spectra;
}

std::pair<std::vector<double>, std::vector<double>> FourierTransform::records(
    std::span<const ComplexDouble> first, std::span<const ComplexDouble> second) const {
  std::vector<ComplexDouble> both(size()), transformed(size());
  for (std::size_t k = 1; k <= num_bins(); ++k) {
    // With conjugate amplitudes at k the forward transform is that of e^(+2πi jk/n).
    const ComplexDouble a = 0.5 * first[k - 1], b = 0.5 * second[k - 1];
    both[size() - k] = {a.real() - b.imag(), a.imag() + b.real()};
    both[k] = {a.real() + b.imag(), b.real() - a.imag()};
  }
  transform(both.data(), 1, transformed.data(), size());
  std::pair<std::vector<double>, std::vector<double>> records;
  for (const ComplexDouble& value : transformed) {
    records.first.push_back(value.real());
    records.second.push_back(value.imag());
  }
  return records;
}

}  // namespace proofmass
