#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/simulation/sample_noise.hpp"
#include "core/signal/noise_shape.hpp"

namespace proofmass {
namespace {

constexpr double period_s = 0.25;
constexpr std::size_t segment_length = 1 << 18;  // 18 hours: bins of 1.5e-5 Hz.
constexpr double bin_hz = 1.0 / (period_s * segment_length);
constexpr std::size_t num_runs = 8;
constexpr std::uint64_t seed = 2013;

using Samples = std::array<double, num_noise_channels>;

Samples flat(const SampleNoise<double>& noise) {
  Samples samples{};
  const std::array<const Vector3<double>*, 6> vectors{&noise.sensor_K[0], &noise.sensor_K[1],
                                                      &noise.angular_S,   &noise.star_tracker_S,
                                                      &noise.thrust_S,    &noise.torque_S};
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = (*vectors[i / 3])[i % 3];
  return samples;
}

/// Channels of one law, averaged together.
enum Group : std::size_t {
  sensor_x,
  sensor_yz,
  angular,
  star_tracker_x,
  star_tracker_yz,
  thrust,
  torque
};
constexpr std::size_t num_groups = 7;
constexpr std::array<Group, num_noise_channels> group_of{
    sensor_x, sensor_yz, sensor_yz, sensor_x,       sensor_yz,       sensor_yz,
    angular,  angular,   angular,   star_tracker_x, star_tracker_yz, star_tracker_yz,
    thrust,   thrust,    thrust,    torque,         torque,          torque};

struct GroupSpectrum {
  std::vector<double> psd = std::vector<double>(segment_length / 2, 0.0);  ///< unit²/Hz
  int num_segments = 0;
};

/// One-sided periodogram of a record under a Hann window, Σw² = 3n/8, added to the group's.
void add_periodogram(std::vector<double>& record, GroupSpectrum& spectrum) {
  for (std::size_t k = 0; k < segment_length; ++k) {
    const double turns = static_cast<double>(k) / segment_length;
    record[k] *= 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * turns);
  }
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> transform;
  fft.fwd(transform, record);
  constexpr double density = 2.0 * period_s / (0.375 * segment_length);
  for (std::size_t m = 0; m < spectrum.psd.size(); ++m) {
    spectrum.psd[m] += density * std::norm(transform[m]);
  }
  ++spectrum.num_segments;
}

using Spectra = std::array<GroupSpectrum, num_groups>;

Spectra measured_spectra(NoisePreset preset) {
  const NoiseModel model = make_noise_model(noise_preset(preset), period_s);
  Spectra spectra;
  std::vector<std::vector<double>> records(num_noise_channels, std::vector<double>(segment_length));
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    SessionNoise noise(model, seed, RunIndex{run}, "spectrum");
    for (std::size_t k = 0; k < segment_length; ++k) {
      const Samples samples = flat(noise.next());
      for (std::size_t i = 0; i < samples.size(); ++i) records[i][k] = samples[i];
    }
    for (std::size_t i = 0; i < records.size(); ++i) {
      add_periodogram(records[i], spectra[group_of[i]]);
    }
  }
  for (GroupSpectrum& spectrum : spectra) {
    for (double& value : spectrum.psd) value /= spectrum.num_segments;
  }
  return spectra;
}

/// What a Hann window makes of a density: its neighbours count one sixth each.
template <typename Density>
double windowed(Density density, std::size_t bin) {
  const double f = bin_hz * static_cast<double>(bin);
  return (density(f - bin_hz) + 4.0 * density(f) + density(f + bin_hz)) / 6.0;
}

/// Compares half-octave bands from 6e-5 Hz to `highest_hz` with a density.
///
/// A periodogram's bin has the relative deviation 1; neighbours correlate by (2/3)² and the next by
/// (1/6)² under the Hann window. The mean of K bins of M segments therefore has the standard error
/// √((1 + 2·(4/9 + 1/36))/(K·M)). Five of them are allowed, and `model_tolerance` besides.
template <typename Density>
void expect_spectrum(const GroupSpectrum& spectrum, Density density, double highest_hz,
                     double model_tolerance, const std::string& name) {
  double first = 4.0;
  while (first * std::numbers::sqrt2 * bin_hz < highest_hz) {
    const double last = first * std::numbers::sqrt2;
    const auto begin = static_cast<std::size_t>(std::ceil(first));
    const auto end = static_cast<std::size_t>(std::ceil(last));
    first = last;
    const auto count = static_cast<double>(end - begin);
    double ratio = 0.0;
    for (std::size_t m = begin; m < end; ++m) {
      ratio += spectrum.psd[m] / windowed(density, m) / count;
    }
    const double error = std::sqrt((1.0 + 17.0 / 18.0) / (count * spectrum.num_segments));
    EXPECT_NEAR(ratio, 1.0, 5.0 * error + model_tolerance)
        << name << " from " << bin_hz * static_cast<double>(begin) << " Hz";
  }
}

// Against the filter's own response nothing but chance is allowed, up to the Nyquist frequency;
// against the nominal curve half a decibel more, up to 1 Hz.
void expect_coloured(const GroupSpectrum& spectrum, const SensorNoise& noise,
                     const std::string& name) {
  const NoiseShape shape = shape_noise(noise, period_s);
  expect_spectrum(
      spectrum, [&](double f) { return shape.psd(f, period_s); }, 2.0, 0.0, name + " (filter)");
  expect_spectrum(
      spectrum, [&](double f) { return nominal_psd(noise, f); }, 1.0, std::pow(10.0, 0.05) - 1.0,
      name);
}

void expect_white(const GroupSpectrum& spectrum, double asd, const std::string& name) {
  expect_spectrum(
      spectrum, [asd](double) { return asd * asd; }, 2.0, 0.0, name);
}

// The fused star tracker: two heads, a = 7e-6 across and b = 3.5e-5 about boresights at ±45° in the
// YZ plane. About X both see across, so a²/2; about Y and Z one half of each, so 1/(1/a² + 1/b²).
TEST(SessionNoise, HasTheSpectraOfTheDesign) {
  const NoiseConfig config = noise_preset(NoisePreset::design_2013);
  const Spectra spectra = measured_spectra(config.preset);
  expect_coloured(spectra[sensor_x], config.linear_x, "sensor X");
  expect_coloured(spectra[sensor_yz], config.linear_yz, "sensor YZ");
  expect_coloured(spectra[angular], config.angular, "angular");
  expect_white(spectra[thrust], 4.7e-10, "thrust");
  expect_white(spectra[torque], 1e-9, "torque");
  const double a = 7e-6;
  const double b = 3.5e-5;
  expect_white(spectra[star_tracker_x], a / std::numbers::sqrt2, "star tracker X");
  expect_white(spectra[star_tracker_yz], 1.0 / std::sqrt(1.0 / (a * a) + 1.0 / (b * b)),
               "star tracker YZ");
}

TEST(SessionNoise, HasTheSpectraOfTheFlight) {
  const NoiseConfig config = noise_preset(NoisePreset::flight_suref);
  const Spectra spectra = measured_spectra(config.preset);
  expect_coloured(spectra[sensor_x], config.linear_x, "sensor X");
  expect_coloured(spectra[sensor_yz], config.linear_yz, "sensor YZ");
}

/// Variance of the mean of n successive samples: ∫ S(f) |sin(πfnT)/(n sin(πfT))|² df.
double variance_of_mean(const NoiseShape& shape, std::size_t n) {
  constexpr int num_steps = 400'000;
  constexpr double lowest_hz = 1e-8;
  const double step = std::log(0.5 / period_s / lowest_hz) / num_steps;
  double sum = lowest_hz * shape.psd(lowest_hz, period_s);
  for (int i = 0; i < num_steps; ++i) {
    const double f = lowest_hz * std::exp(step * (i + 0.5));
    const double x = std::numbers::pi * f * period_s;
    const double ratio =
        std::sin(static_cast<double>(n) * x) / (static_cast<double>(n) * std::sin(x));
    sum += step * f * shape.psd(f, period_s) * ratio * ratio;
  }
  return sum;
}

constexpr std::size_t mean_length = 1024;

/// Mean square of the means of samples [first, first + 1024) of the three angular channels.
double mean_square_of_means(std::size_t first, std::uint64_t num_draws) {
  const NoiseModel model = make_noise_model(NoiseConfig{}, period_s);
  double sum = 0.0;
  for (std::uint64_t run = 0; run < num_draws; ++run) {
    SessionNoise noise(model, seed, RunIndex{run}, "start");
    for (std::size_t k = 0; k < first; ++k) static_cast<void>(noise.next());
    Vector3<double> mean;
    for (std::size_t k = 0; k < mean_length; ++k) mean += noise.next().angular_S;
    mean = (1.0 / static_cast<double>(mean_length)) * mean;
    sum += dot(mean, mean);
  }
  return sum / (3.0 * static_cast<double>(num_draws));
}

// The mean over four minutes is mostly 1/f noise older than the record: a start from rest would
// have a third of this variance. Of n = 3·1000 means the mean square has the relative standard
// error √(2/n).
TEST(SessionNoise, StartsInItsStationaryState) {
  const double expected =
      variance_of_mean(shape_noise(NoiseConfig{}.angular, period_s), mean_length);
  const double tolerance = 5.0 * std::sqrt(2.0 / 3000.0);
  EXPECT_NEAR(mean_square_of_means(0, 1000) / expected, 1.0, tolerance);
  EXPECT_NEAR(mean_square_of_means(2000, 1000) / expected, 1.0, tolerance);
}

// 153 pairs of n = 10⁵ samples, differenced so that 1/f does not correlate them by chance. A
// spectrum of fᵖ then makes the correlation's standard error √((p + 1)²/((2p + 1) n)), at most
// √(4/n) for the f⁶ of a differenced rise.
TEST(SessionNoise, ChannelsAreUncorrelated) {
  constexpr std::size_t n = 100'000;
  const NoiseModel model = make_noise_model(NoiseConfig{}, period_s);
  SessionNoise noise(model, seed, RunIndex{3}, "channels");
  std::array<std::array<double, num_noise_channels>, num_noise_channels> product{};
  Samples before = flat(noise.next());
  for (std::size_t k = 0; k < n; ++k) {
    const Samples now = flat(noise.next());
    for (std::size_t i = 0; i < num_noise_channels; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        product[i][j] += (now[i] - before[i]) * (now[j] - before[j]);
      }
    }
    before = now;
  }
  for (std::size_t i = 0; i < num_noise_channels; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double correlation = product[i][j] / std::sqrt(product[i][i] * product[j][j]);
      EXPECT_NEAR(correlation, 0.0, 5.0 * std::sqrt(4.0 / static_cast<double>(n)))
          << noise_channel_names()[i] << ", " << noise_channel_names()[j];
    }
  }
}

}  // namespace
}  // namespace proofmass
