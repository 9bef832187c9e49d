#include "core/microscope/simulation/sample_noise.hpp"

#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::size_t num_samples = 100;

/// The 18 channels of a sample.
std::array<double, num_noise_channels> channels(const SampleNoise<double>& noise) {
  std::array<double, num_noise_channels> values{};
  std::size_t next = 0;
  for (const Vector3<double>& v : {noise.sensor_K[0], noise.sensor_K[1], noise.angular_S,
                                   noise.star_tracker_S, noise.thrust_S, noise.torque_S}) {
    for (const double value : {v.x, v.y, v.z}) values[next++] = value;
  }
  return values;
}

std::vector<std::array<double, num_noise_channels>> samples_at(double scale) {
  NoiseConfig config;
  config.scale = scale;
  const NoiseModel model = make_noise_model(config, period_s);
  SessionNoise noise(model, /*seed=*/1, RunIndex{0}, "a_c12");
  std::vector<std::array<double, num_noise_channels>> samples;
  for (std::size_t i = 0; i < num_samples; ++i) samples.push_back(channels(noise.next()));
  return samples;
}

// Every channel is a weighted sum of the same deviates. The scale is a factor of each weight, and a
// sum has at most 14 terms, each rounded twice; terms cancel to a hundredth at worst in so few
// samples.
TEST(NoiseScale, MultipliesEveryChannel) {
  const auto once = samples_at(1.0);
  for (const double scale : {3.0, 0.0}) {
    const auto scaled = samples_at(scale);
    for (std::size_t i = 0; i < num_samples; ++i) {
      for (std::size_t channel = 0; channel < num_noise_channels; ++channel) {
        const double expected = scale * once[i][channel];
        ASSERT_NEAR(scaled[i][channel], expected, 1e-12 * std::abs(expected))
            << noise_channel_names()[channel];
      }
    }
  }
}

}  // namespace
}  // namespace proofmass
