#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/math/elementary.hpp"
#include "core/random/normal_deviates.hpp"
#include "gradiometer.hpp"

namespace proofmass {
namespace {

using Record = std::vector<double>;

/// Of one axis, m/s²/√Hz or rad/s²/√Hz.
struct Shake {
  double largest;    ///< From 0.06 to 0.1 Hz.
  double lowest_hz;  ///< There is none below.

  [[nodiscard]] double density(double frequency_hz) const {
    constexpr double band_hz = 0.06, end_hz = 0.1, nyquist_hz = 0.5, last = 1e-10;
    if (frequency_hz < lowest_hz || largest == 0.0) return 0.0;
    if (frequency_hz < band_hz) return 0.1 * largest;
    if (frequency_hz <= end_hz) return largest;
    return 0.1 * largest + (last - 0.1 * largest) * (frequency_hz - end_hz) / (nyquist_hz - end_hz);
  }
};

/// What thrusters add: from 100 µN below 0.3 mHz to 1 µN above 30 mHz, falling with the frequency
/// between, on 1,000 kg.
double thruster_m_s2_rthz(double frequency_hz) {
  const double force_n = std::min(1e-4, std::max(1e-6, 1e-4 * 3e-4 / frequency_hz));
  return force_n / 1000.0;
}

/// Lines of known size with random phases.
Amplitudes comb(const Sampling& sampling, const RandomStream& stream, const Shake& shake,
                std::size_t axis) {
  const auto bins = static_cast<std::uint32_t>(sampling.transform.num_bins());
  const double spacing_hz = sampling.spacing_hz();
  Amplitudes amplitudes;
  for (std::uint32_t k = 1; k <= bins; ++k) {
    const double frequency_hz = k * spacing_hz;
    const double shaking = shake.density(frequency_hz);
    const double thrust = axis < 3 ? thruster_m_s2_rthz(frequency_hz) : 0.0;
    const double amplitude = std::sqrt(2.0 * spacing_hz * (shaking * shaking + thrust * thrust));
    const auto index = static_cast<std::uint32_t>(axis) * bins + k - 1;
    const SineCosine phase = sincos_turns(uniform(stream.block(index)));
    amplitudes.emplace_back(amplitude * phase.cosine, amplitude * phase.sine);
  }
  return amplitudes;
}

/// Gaussian noise of a one-sided density.
Amplitudes noise(const Sampling& sampling, const RandomStream& stream, double factor,
                 double (*density)(double), std::size_t channel) {
  const auto bins = static_cast<std::uint32_t>(sampling.transform.num_bins());
  const double spacing_hz = sampling.spacing_hz();
  Amplitudes amplitudes;
  for (std::uint32_t k = 1; k <= bins; ++k) {
    const double deviation = factor * density(k * spacing_hz) * std::sqrt(spacing_hz);
    const auto index = static_cast<std::uint32_t>(channel) * bins + k - 1;
    const auto deviates = normal_deviates(stream.block(index));
    amplitudes.emplace_back(deviation * static_cast<double>(deviates[0]),
                            deviation * static_cast<double>(deviates[1]));
  }
  return amplitudes;
}

/// The integral over time: division by 2πif.
Amplitudes integral(const Amplitudes& amplitudes, double spacing_hz) {
  Amplitudes result;
  for (std::size_t k = 0; k < amplitudes.size(); ++k) {
    const double omega = 2.0 * std::numbers::pi * spacing_hz * static_cast<double>(k + 1);
    result.emplace_back(amplitudes[k].imag() / omega, -amplitudes[k].real() / omega);
  }
  return result;
}

Amplitudes sum(const Amplitudes& a, const Amplitudes& b) {
  Amplitudes result;
  for (std::size_t k = 0; k < a.size(); ++k) result.push_back(a[k] + b[k]);
  return result;
}

/// Angular acceleration, rate and angle about one axis, in time.
std::array<Record, 3> rotation_records(const Sampling& sampling, const Amplitudes& acceleration) {
  const FourierTransform& transform = sampling.transform;
  const double spacing_hz = sampling.spacing_hz();
  const Amplitudes rate = integral(acceleration, spacing_hz);
  auto [first, second] = transform.records(acceleration, rate);
  auto [third, none] = transform.records(integral(rate, spacing_hz), Amplitudes(rate.size()));
  return {std::move(first), std::move(second), std::move(third)};
}

/// The satellite's rotation from records of each axis, beside the orbit's rate.
std::vector<Rotation> rotations(const std::array<std::array<Record, 3>, 3>& axes,
                                double orbit_rate_rad_s) {
  std::vector<Rotation> rotations(axes[0][0].size());
  for (std::size_t j = 0; j < rotations.size(); ++j) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rotations[j].acceleration_rad_s2[axis] = axes[axis][0][j];
      rotations[j].rate_rad_s[axis] = axes[axis][1][j];
      rotations[j].angle_rad[axis] = axes[axis][2][j];
    }
    rotations[j].rate_rad_s.y -= orbit_rate_rad_s;
  }
  return rotations;
}

}  // namespace

double accelerometer_noise_m_s2_rthz(double frequency_hz) {
  const double f2 = frequency_hz * frequency_hz;
  return 2e-12 * std::sqrt(1.2 + 0.002 / frequency_hz + 6000.0 * f2 * f2);
}

double angular_noise_rad_s2_rthz(double frequency_hz) {
  const double f2 = frequency_hz * frequency_hz;
  const double accelerometer = 1e-20 * (0.4 + 0.001 / frequency_hz + 2500.0 * f2 * f2);
  const double omega2 = 4.0 * std::numbers::pi * std::numbers::pi * f2;
  const double star_tracker = 8.5e-6 * 8.5e-6 / frequency_hz * omega2 * omega2;
  return std::sqrt(1.0 / (1.0 / accelerometer + 1.0 / star_tracker));
}

Motion shaken(const Gradiometer& settings, const Sampling& sampling, std::uint64_t seed,
              RunIndex run) {
  const RandomStream stream(seed, run, stream_id("shaking"));
  Motion motion;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    motion.linear_m_s2[axis] =
        comb(sampling, stream, {settings.linear_m_s2_rthz, settings.lowest_hz}, axis);
    motion.angular_rad_s2[axis] =
        comb(sampling, stream, {settings.angular_rad_s2_rthz, settings.lowest_hz}, 3 + axis);
  }
  return motion;
}

Motion in_science(const Gradiometer& settings, const Sampling& sampling, std::uint64_t seed,
                  RunIndex run) {
  const RandomStream stream(seed, run, stream_id("science"));
  const std::size_t bins = sampling.transform.num_bins();
  const double orbit_hz = settings.orbit_rate_rad_s() / (2.0 * std::numbers::pi);
  const double orbits = std::max(1.0, std::round(orbit_hz / sampling.spacing_hz()));
  const auto orbit_bin = static_cast<std::size_t>(orbits);
  Motion motion;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    motion.linear_m_s2[axis] = comb(sampling, stream, {}, axis);
    motion.angular_rad_s2[axis].resize(bins);
    if (axis == 0) continue;
    const auto index = static_cast<std::uint32_t>(3 * bins + axis);
    const SineCosine phase = sincos_turns(uniform(stream.block(index)));
    motion.linear_m_s2[axis][orbit_bin - 1] +=
        ComplexDouble(settings.drag_m_s2 * phase.cosine, settings.drag_m_s2 * phase.sine);
  }
  return motion;
}

Measurement measure(const Gradiometer& settings, const Sampling& sampling, const Motion& motion,
                    std::span<const double> unknowns, const RandomStream& noises) {
  const FourierTransform& transform = sampling.transform;
  const double factor = settings.noise_factor, orbit_rate = settings.orbit_rate_rad_s();
  std::array<std::array<Record, 3>, 3> true_axes, measured_axes;
  std::array<Record, 3> a_ng;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Amplitudes& angular = motion.angular_rad_s2[axis];
    true_axes[axis] = rotation_records(sampling, angular);
    measured_axes[axis] = rotation_records(
        sampling, sum(angular, noise(sampling, noises, factor, angular_noise_rad_s2_rthz, axis)));
    const Amplitudes& linear = motion.linear_m_s2[axis];
    a_ng[axis] = transform.records(linear, Amplitudes(linear.size())).first;
  }
  const std::vector<Rotation> rotation = rotations(true_axes, orbit_rate);
  Measurement measurement{.rotation = rotations(measured_axes, orbit_rate)};
  for (std::size_t j = 0; j < transform.size(); ++j) {
    measurement.a_ng_m_s2.push_back({a_ng[0][j], a_ng[1][j], a_ng[2][j]});
  }
  const std::array<Accelerometer, 3> sensors = sensors_of(unknowns, settings.length_m);
  for (std::size_t i = 0; i < 3; ++i) {
    std::array<Record, 3> noise_records;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Amplitudes amplitudes =
          noise(sampling, noises, factor, accelerometer_noise_m_s2_rthz, 3 + 3 * i + axis);
      noise_records[axis] = transform.records(amplitudes, Amplitudes(amplitudes.size())).first;
    }
    for (std::size_t j = 0; j < transform.size(); ++j) {
      const Vector3<double> noise{noise_records[0][j], noise_records[1][j], noise_records[2][j]};
      measurement.readings_m_s2[i].push_back(reading(sensors[i], measurement.a_ng_m_s2[j],
                                                     acceleration_gradient(rotation[j], orbit_rate),
                                                     rotation[j].acceleration_rad_s2) +
                                             noise);
    }
  }
  return measurement;
}

}  // namespace proofmass
