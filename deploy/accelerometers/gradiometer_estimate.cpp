// The fit of a gradiometer's unknowns. a_ng is not known: in each round it is what makes the three
// residuals of a sample add up to 0 with the present estimates. What remains are
//
//     y_d = (y₁ − y₃)/2    and    y_c = y₂ − (y₁ + y₃)/2
//
// Their derivatives by the unknowns are sums of 24 signals, the same for all unknowns, with
// constant coefficients. So a round transforms these signals and the six residuals, adds up the
// weighted products of any two over the frequencies, and all else is algebra of small matrices.

#include <cmath>
#include <numbers>

#include "gradiometer.hpp"
#include "normal_equations.hpp"

namespace proofmass {
namespace {

/// Signals by number: a_ng, the elements of G, aᵢ ∘ aᵢ and ω̇, then the residuals of y_d and y_c.
constexpr std::size_t gradient_signal = 3, square_signal = 12, angular_signal = 21,
                      residual_signal = 24, num_signals = 30;
/// What a series is as a sum of signals, of each unknown.
using Derivatives = std::array<std::array<double, residual_signal>, Unknowns::count>;
using AxisDerivatives = std::array<Derivatives, 3>;

struct SignalTable {
  std::array<std::vector<double>, num_signals> signals;

  void add(std::size_t first, const Vector3<double>& values) {
    for (std::size_t axis = 0; axis < 3; ++axis) signals[first + axis].push_back(values[axis]);
  }
};

/// a_ng of one sample, and all that the fit takes of it.
void add_sample(const Measurement& measurement, std::size_t sample, double orbit_rate_rad_s,
                const std::array<Accelerometer, 3>& sensors, SignalTable& table) {
  const Rotation& rotation = measurement.rotation[sample];
  const Matrix3<double> gradient = acceleration_gradient(rotation, orbit_rate_rad_s);
  Vector3<double> a_ng;
  std::array<Vector3<double>, 3> residuals;
  // Each step leaves some thousandths of the error, as the sensors have errors of some thousandths.
  for (int step = 0; step < 6; ++step) {
    Vector3<double> total;
    for (std::size_t i = 0; i < 3; ++i) {
      residuals[i] = measurement.readings_m_s2[i][sample] -
                     reading(sensors[i], a_ng, gradient, rotation.acceleration_rad_s2);
      total += residuals[i];
    }
    a_ng += (1.0 / 3.0) * total;
  }
  table.add(0, a_ng);
  for (std::size_t q = 0; q < 3; ++q) table.add(gradient_signal + 3 * q, gradient.row[q]);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3<double> a = gradient * sensors[i].place_m + a_ng;
    table.add(square_signal + 3 * i, scaled(a, a));
  }
  table.add(angular_signal, rotation.acceleration_rad_s2);
  table.add(residual_signal, 0.5 * (residuals[0] - residuals[2]));
  table.add(residual_signal + 3, residuals[1] - 0.5 * (residuals[0] + residuals[2]));
}

/// Of sensor i's reading, with a_ng held.
AxisDerivatives derivatives_of_sensor(const std::array<Accelerometer, 3>& sensors, std::size_t i) {
  const Accelerometer& sensor = sensors[i];
  AxisDerivatives of{};
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t q = 0; q < 3; ++q) {
      auto& by_matrix = of[p][Unknowns::matrix + 9 * i + 3 * p + q];
      by_matrix[q] = 1.0;
      for (std::size_t l = 0; l < 3; ++l) {
        by_matrix[gradient_signal + 3 * q + l] = sensor.place_m[l];
      }
    }
    of[p][Unknowns::quadratic + 3 * i + p][square_signal + 3 * i + p] = 1.0;
    if (i == 1) continue;
    for (std::size_t l = 0; l < 3; ++l) {
      // The third sensor's δr_x is that of the first.
      const std::size_t unknown = Unknowns::place + (i == 2 && l > 0 ? 2 + l : l);
      for (std::size_t q = 0; q < 3; ++q) {
        of[p][unknown][gradient_signal + 3 * q + l] += sensor.matrix.row[p][q];
      }
    }
  }
  if (i == 1) return of;
  for (std::size_t w = 0; w < 3; ++w) {
    const auto [row, column] = coupling_places[w];
    of[row][Unknowns::coupling + (i == 2 ? 3 : 0) + w][angular_signal + column] = 1.0;
  }
  return of;
}

/// target += factor · source
void accumulate(Derivatives& target, double factor, const Derivatives& source) {
  for (std::size_t j = 0; j < target.size(); ++j) {
    for (std::size_t s = 0; s < residual_signal; ++s) target[j][s] += factor * source[j][s];
  }
}

/// Of y_d and y_c, x to z each, with the a_ng that follows from the estimates: it moves by minus
/// the mean of what the readings move by.
std::array<Derivatives, 6> derivatives(const std::array<Accelerometer, 3>& sensors) {
  std::array<AxisDerivatives, 3> of;
  for (std::size_t i = 0; i < 3; ++i) of[i] = derivatives_of_sensor(sensors, i);
  AxisDerivatives a_ng{};
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t i = 0; i < 3; ++i) accumulate(a_ng[p], -1.0 / 3.0, of[i][p]);
  }
  std::array<Derivatives, 6> series{};
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t q = 0; q < 3; ++q)
        accumulate(of[i][p], sensors[i].matrix.row[p][q], a_ng[q]);
    }
    accumulate(series[p], 0.5, of[0][p]);
    accumulate(series[p], -0.5, of[2][p]);
    accumulate(series[3 + p], 1.0, of[1][p]);
    accumulate(series[3 + p], -0.5, of[0][p]);
    accumulate(series[3 + p], -0.5, of[2][p]);
  }
  return series;
}

/// Noise of y_d, x to z, and of y_c, as one-sided power spectral densities, m²/s⁴/Hz. In y_d there
/// is noise of the rotation: G has the half baseline as a factor, and to first order
///
///     δG_xx = 2n δω_y,    δG_yx = δω̇_z − n δω_x,    δG_zx = −δω̇_y + 3n² δθ_y.
std::array<double, 4> noise_densities(double frequency_hz, double half_m, double orbit_rate_rad_s) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  const double reading = accelerometer_noise_m_s2_rthz(frequency_hz);
  const double angular = angular_noise_rad_s2_rthz(frequency_hz) * half_m;
  const double ratio2 = orbit_rate_rad_s * orbit_rate_rad_s / (omega * omega);
  const double s = reading * reading, g = angular * angular;
  return {0.5 * s + 4.0 * ratio2 * g, 0.5 * s + (1.0 + ratio2) * g,
          0.5 * s + (1.0 + 3.0 * ratio2) * (1.0 + 3.0 * ratio2) * g, 1.5 * s};
}

using Products = std::array<std::array<double, num_signals>, num_signals>;

/// Σ over the frequencies of the weighted products of any two signals, for each of the four noises.
/// A signal that does not enter a fit's derivatives is its residual.
std::array<Products, 4> weighted_products(const Gradiometer& settings,
                                          const FourierTransform& transform,
                                          const SignalTable& table) {
  std::array<std::vector<ComplexDouble>, num_signals> spectra;
  for (std::size_t s = 0; s < num_signals; s += 2) {
    std::tie(spectra[s], spectra[s + 1]) =
        transform.spectra(table.signals[s], table.signals[s + 1]);
  }
  const auto n = static_cast<double>(transform.size());
  std::array<Products, 4> products{};
  std::array<double, num_signals> real{}, imaginary{};
  for (std::size_t k = 0; k < transform.num_bins(); ++k) {
    const double frequency_hz = static_cast<double>(k + 1) / n;
    if (frequency_hz < settings.lowest_hz) continue;
    for (std::size_t s = 0; s < num_signals; ++s) {
      real[s] = spectra[s][k].real();
      imaginary[s] = spectra[s][k].imag();
    }
    const auto densities =
        noise_densities(frequency_hz, 0.5 * settings.length_m, settings.orbit_rate_rad_s());
    Products at;
    for (std::size_t a = 0; a < residual_signal; ++a) {
      for (std::size_t b = 0; b < num_signals; ++b) {
        at[a][b] = real[a] * real[b] + imaginary[a] * imaginary[b];
      }
    }
    for (std::size_t noise = 0; noise < 4; ++noise) {
      // Real and imaginary part of a transform have the variance n S/4 each, at one sample a
      // second.
      const double weight = 4.0 / (n * densities[noise]);
      for (std::size_t a = 0; a < residual_signal; ++a) {
        for (std::size_t b = 0; b < num_signals; ++b) products[noise][a][b] += weight * at[a][b];
      }
    }
  }
  return products;
}

/// Adds the normal equations of one series.
void add_series(const Derivatives& derivatives, const Products& products, std::size_t residual,
                Eigen::MatrixXd& normal, Eigen::VectorXd& gradient) {
  for (std::size_t i = 0; i < Unknowns::count; ++i) {
    std::array<double, num_signals> row{};
    for (std::size_t a = 0; a < residual_signal; ++a) {
      if (derivatives[i][a] == 0.0) continue;
      for (std::size_t b = 0; b < num_signals; ++b) row[b] += derivatives[i][a] * products[a][b];
    }
    gradient[i] += row[residual];
    for (std::size_t j = 0; j < Unknowns::count; ++j) {
      for (std::size_t b = 0; b < residual_signal; ++b) normal(i, j) += row[b] * derivatives[j][b];
    }
  }
}

}  // namespace

Fit fit(const Gradiometer& settings, const FourierTransform& transform,
        const Measurement& measurement) {
  Fit fit{.unknowns = std::vector<double>(Unknowns::count)};
  while (!fit.has_converged && fit.num_rounds < settings.num_rounds_max()) {
    ++fit.num_rounds;
    const std::array<Accelerometer, 3> sensors = sensors_of(fit.unknowns, settings.length_m);
    SignalTable table;
    for (std::size_t j = 0; j < transform.size(); ++j) {
      add_sample(measurement, j, settings.orbit_rate_rad_s(), sensors, table);
    }
    const auto products = weighted_products(settings, transform, table);
    const auto of = derivatives(sensors);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(Unknowns::count, Unknowns::count);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(Unknowns::count);
    for (std::size_t series = 0; series < 6; ++series) {
      add_series(of[series], products[std::min<std::size_t>(series, 3)], residual_signal + series,
                 normal, gradient);
    }
    const std::optional<Eigen::MatrixXd> inverse = covariance(normal);
    if (!inverse) return fit;
    const Eigen::VectorXd step = *inverse * gradient;
    fit.covariance = *inverse;
    fit.has_converged = true;
    for (std::size_t i = 0; i < Unknowns::count; ++i) {
      fit.unknowns[i] += step[i];
      // A thousandth of the standard error.
      if (step[i] * step[i] > 1e-6 * (*inverse)(i, i)) fit.has_converged = false;
    }
  }
  return fit;
}

}  // namespace proofmass
