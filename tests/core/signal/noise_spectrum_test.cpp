#include "core/microscope/campaign/scenario.hpp"
#include "core/microscope/simulation/sample_noise.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/support/averaged_spectrum.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::size_t segment_length = 1 << 18;  // 18 hours: bins of 1.5e-5 Hz.
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

using Spectra = std::vector<test::AveragedSpectrum>;

Spectra measured_spectra(NoisePreset preset) {
  const NoiseModel model = make_noise_model(noise_preset(preset), period_s);
  Spectra spectra(num_groups, test::AveragedSpectrum(segment_length, period_s));
  std::vector<std::vector<double>> records(num_noise_channels, std::vector<double>(segment_length));
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    SessionNoise noise(model, seed, RunIndex{run}, "spectrum");
    for (std::size_t k = 0; k < segment_length; ++k) {
      const Samples samples = flat(noise.next());
      for (std::size_t i = 0; i < samples.size(); ++i) records[i][k] = samples[i];
    }
    for (std::size_t i = 0; i < records.size(); ++i) {
      spectra[group_of[i]].add(records[i]);
    }
  }
  return spectra;
}

// Against the filter's own response nothing but chance is allowed, up to the Nyquist frequency;
// against the nominal curve half a decibel more, up to 1 Hz.
void expect_coloured(const test::AveragedSpectrum& spectrum, const SensorNoise& noise,
                     const std::string& name) {
  const NoiseShape shape = shape_noise(noise, period_s);
  spectrum.expect([&](double f) { return shape.psd(f, period_s); }, 2.0, 0.0, name + " (filter)");
  spectrum.expect([&](double f) { return nominal_psd(noise, f); }, 1.0, std::pow(10.0, 0.05) - 1.0,
                  name);
}

void expect_white(const test::AveragedSpectrum& spectrum, double asd, const std::string& name) {
  spectrum.expect([asd](double) { return asd * asd; }, 2.0, 0.0, name);
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
