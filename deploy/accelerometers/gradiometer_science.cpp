// What a calibration is worth in science data, where a_ng between 0.1 and 1 mHz is wanted. Two days
// of it have 155 lines there. A sample each two minutes holds them, and all lines below 4.2 mHz; K
// makes less than 1e-16 m/s² of the faster ones, a 5000th of what is required.

#include <cmath>

#include "gradiometer.hpp"

namespace proofmass {
namespace {

constexpr std::size_t num_samples = 1440;
constexpr double period_s = 120.0;
constexpr double first_hz = 1e-4, last_hz = 1e-3;
/// The direction to the other satellite, in which a_ng is wanted; both have errors of this size.
constexpr Vector3<double> line_of_sight{1.0, 1e-5, 1e-5};
constexpr double num_satellites = 2.0;

/// One-sided.
double required_psd(double frequency_hz) {
  const double low = 1e-3 / frequency_hz, high = 100.0 * frequency_hz * frequency_hz;
  return 25e-24 * (1.0 + low * low + high * high);
}

/// Its rows are cross products of the columns, over the determinant.
Matrix3<double> inverse(const Matrix3<double>& m) {
  const auto column = [&](std::size_t q) {
    return Vector3<double>{m.row[0][q], m.row[1][q], m.row[2][q]};
  };
  const Vector3<double> a = column(0), b = column(1), c = column(2);
  const double factor = 1.0 / dot(a, cross(b, c));
  return {{factor * cross(b, c), factor * cross(c, a), factor * cross(a, b)}};
}

/// The mean of what the three sensors say, each without its place.
///
///     a ← M⁻¹ (y − K (a ∘ a) − W ω̇), three times from a = y;    a_ng = mean of a − G r
std::vector<Vector3<double>> reconstructed_a_ng(const Gradiometer& settings,
                                                const Measurement& measurement,
                                                std::span<const double> unknowns) {
  const std::array<Accelerometer, 3> sensors = sensors_of(unknowns, settings.length_m);
  std::vector<Vector3<double>> a_ng(measurement.rotation.size());
  for (std::size_t i = 0; i < 3; ++i) {
    const Matrix3<double> calibration = inverse(sensors[i].matrix);
    for (std::size_t j = 0; j < a_ng.size(); ++j) {
      const Rotation& rotation = measurement.rotation[j];
      const Vector3<double> y = measurement.readings_m_s2[i][j];
      Vector3<double> a = y;
      for (int step = 0; step < 3; ++step) {
        a = calibration * (y - scaled(sensors[i].quadratic, scaled(a, a)) -
                           sensors[i].coupling * rotation.acceleration_rad_s2);
      }
      const Matrix3<double> gradient = acceleration_gradient(rotation, settings.orbit_rate_rad_s());
      a_ng[j] += (1.0 / 3.0) * (a - gradient * sensors[i].place_m);
    }
  }
  return a_ng;
}

/// Power of the residual between the two satellites, over what is required.
double power_ratio(const Sampling& sampling, const std::vector<Vector3<double>>& a_ng_m_s2,
                   const std::vector<Vector3<double>>& truth_m_s2) {
  const double length = std::sqrt(dot(line_of_sight, line_of_sight));
  std::vector<double> residual;
  for (std::size_t j = 0; j < truth_m_s2.size(); ++j) {
    residual.push_back(dot(line_of_sight, a_ng_m_s2[j] - truth_m_s2[j]) / length);
  }
  const auto spectrum = sampling.transform.spectra(residual, residual).first;
  const auto n = static_cast<double>(sampling.transform.size());
  double power = 0.0, required = 0.0;
  for (std::size_t k = 1; k <= spectrum.size(); ++k) {
    const double frequency_hz = static_cast<double>(k) * sampling.spacing_hz();
    if (frequency_hz < first_hz || frequency_hz > last_hz) continue;
    const double real = spectrum[k - 1].real(), imaginary = spectrum[k - 1].imag();
    power += num_satellites * 2.0 * sampling.period_s / n * (real * real + imaginary * imaginary);
    required += required_psd(frequency_hz);
  }
  return power / required;
}

}  // namespace

ScienceRatios science_ratios(const Gradiometer& settings, std::span<const double> truth,
                             std::span<const double> estimate, std::uint64_t seed, RunIndex run) {
  const Sampling sampling{FourierTransform(num_samples), period_s};
  const Measurement measurement =
      measure(settings, sampling, in_science(settings, sampling, seed, run), truth,
              RandomStream(seed, run, stream_id("science noise")));
  const auto ratio = [&](std::span<const double> unknowns) {
    return power_ratio(sampling, reconstructed_a_ng(settings, measurement, unknowns),
                       measurement.a_ng_m_s2);
  };
  return {.calibrated = ratio(estimate),
          .uncalibrated = ratio(std::vector<double>(Unknowns::count)),
          .floor = ratio(truth)};
}

}  // namespace proofmass
