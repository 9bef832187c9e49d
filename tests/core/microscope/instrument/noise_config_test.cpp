#include "core/microscope/instrument/noise_config.hpp"

#include "core/microscope/simulation/sample_noise.hpp"
#include "core/signal/noise_shape.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

// A spring of stiffness k with structural losses 1/Q has the impedance Re Z = k/(Q ω), whose force
// noise is 4 k_B T Re Z.
double force_noise_psd(double damping_n_m, double temperature_k, double frequency_hz) {
  const double resistance = damping_n_m / (2.0 * std::numbers::pi * frequency_hz);
  return 4.0 * 1.380649e-23 * temperature_k * resistance;
}

TEST(WireNoise, IsThermalForceNoiseOverTheMassOfEachSensor) {
  NoiseConfig noise = noise_preset(NoisePreset::wire_suep);
  noise.wire.factor = {1.0, 0.5};
  const double without = noise.linear_x.white_asd * noise.linear_x.white_asd;
  for (const double f : {1e-4, 3.11133e-3}) {
    const double force = force_noise_psd(1.1e-3, 293.0, f);
    const double inner = nominal_psd(linear_x_of(noise, 0), f) - nominal_psd(noise.linear_x, f);
    const double outer = nominal_psd(linear_x_of(noise, 1), f) - nominal_psd(noise.linear_x, f);
    EXPECT_NEAR(inner, force / (0.401706 * 0.401706), 1e-9 * inner + 1e-12 * without);
    EXPECT_NEAR(outer, 0.25 * force / (0.300939 * 0.300939), 1e-9 * outer + 1e-12 * without);
    EXPECT_NEAR(differential_x_psd(noise, f),
                0.25 * (inner + outer) + 0.5 * nominal_psd(noise.linear_x, f), 1e-9 * inner);
  }
}

TEST(WireNoise, LeavesYAndZAlone) {
  const NoiseConfig noise = noise_preset(NoisePreset::wire_suep);
  EXPECT_EQ(linear_yz_of(noise, 0).pink_corner_hz, noise.linear_yz.pink_corner_hz);
}

// The bits of every campaign without wires rest on it.
TEST(NoiseConfig, WithoutWiresIsTheSameToTheBitInBothSensors) {
  for (const NoisePreset preset : {NoisePreset::design_2013, NoisePreset::flight_suref}) {
    const NoiseConfig noise = noise_preset(preset);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_EQ(linear_x_of(noise, k).pink_corner_hz, noise.linear_x.pink_corner_hz);
      EXPECT_EQ(linear_x_of(noise, k).white_asd, noise.linear_x.white_asd);
      EXPECT_EQ(linear_yz_of(noise, k).rise_asd, noise.linear_yz.rise_asd);
    }
    EXPECT_EQ(differential_x_psd(noise, 1e-3), 0.5 * nominal_psd(noise.linear_x, 1e-3));
  }
}

// The same deviates drive all filters, so that a factor of a sensor is one of its samples.
TEST(NoiseModel, GivesEachSensorItsOwnNoise) {
  NoiseConfig plain = noise_preset(NoisePreset::flight_suref);
  NoiseConfig other = plain;
  other.linear_factor = {3.0, 0.5};
  const NoiseModel plain_model = make_noise_model(plain, period_s);
  const NoiseModel other_model = make_noise_model(other, period_s);
  SessionNoise plain_noise(plain_model, 1, RunIndex{0}, "a");
  SessionNoise other_noise(other_model, 1, RunIndex{0}, "a");
  for (int i = 0; i < 100; ++i) {
    const SampleNoise<double> a = plain_noise.next();
    const SampleNoise<double> b = other_noise.next();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double one = a.sensor_K[0][axis], two = a.sensor_K[1][axis];
      EXPECT_NEAR(b.sensor_K[0][axis], 3.0 * one, 1e-9 * std::abs(one));
      EXPECT_NEAR(b.sensor_K[1][axis], 0.5 * two, 1e-9 * std::abs(two));
      EXPECT_EQ(b.angular_S[axis], a.angular_S[axis]);
    }
  }
}

// As noise_shape_test does for the other presets: 0.5 dB from 2e-5 to 1 Hz.
TEST(NoiseModel, FollowsTheWiresAndTheirLimit) {
  NoiseConfig noise = noise_preset(NoisePreset::wire_suep);
  for (const double damping_n_m : {1.1e-3, 0.035}) {  // 0.9 and 1.5 Hz; 28 and 49 Hz.
    noise.wire.damping_n_m = damping_n_m;
    const NoiseModel model = make_noise_model(noise, period_s);
    for (std::size_t k = 0; k < 2; ++k) {
      const SensorNoise asked = linear_x_of(noise, k);
      for (double f = 2e-5; f < 1.0; f *= 1.3) {
        const double ratio = model.linear_x[k].psd(f, period_s) / nominal_psd(asked, f);
        EXPECT_NEAR(10.0 * std::log10(ratio), 0.0, 0.5) << damping_n_m << ", " << k << ", " << f;
      }
    }
  }
}

}  // namespace
}  // namespace proofmass
