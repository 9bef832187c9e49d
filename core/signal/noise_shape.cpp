#include "core/signal/noise_shape.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "core/error.hpp"
#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

using Complex = ComplexDouble;

constexpr double pole_ratio = 8.0;          // Between corners of the 1/f sum.
constexpr double lowest_corner_hz = 6e-6;   // A factor 3 below the lowest frequency that matters.
constexpr double pink_part_min = 0.12;      // The sum ends where 1/f is this part of white,
constexpr double nyquist_parts_max = 16.0;  // or at a corner this far above what samples can tell.

/// S(x)/white² = 1 + Σ gᵢ/(x + xᵢ) + r x²/((x − u)(x − v)), x = 4 sin²(πfT).
struct RationalSpectrum {
  std::vector<double> pole;    ///< xᵢ > 0: the spectrum's poles are at −xᵢ.
  std::vector<double> weight;  ///< gᵢ.
  bool has_rise = false;
  double rise = 0.0;  ///< r.
  Complex u, v;
};

void add_pink(const SensorNoise& noise, double sample_period_s, RationalSpectrum& spectrum) {
  if (noise.pink_corner_hz == 0.0) return;
  const double angle_per_hz = 2.0 * std::numbers::pi * sample_period_s;
  const double highest_hz = noise.pink_corner_hz / pink_part_min;
  for (double corner_hz = lowest_corner_hz;; corner_hz *= pole_ratio) {
    const double corner = angle_per_hz * corner_hz;
    // 1/f = Σ (2 ln ratio/π) fᵢ/(fᵢ² + f²) over corners a factor `ratio` apart.
    double weight = noise.pink_corner_hz * (2.0 * logarithm(pole_ratio) / std::numbers::pi) *
                    corner * angle_per_hz;
    // The first stands also for all those below it: 1 + 1/ratio + 1/ratio² + …
    if (spectrum.pole.empty()) weight *= pole_ratio / (pole_ratio - 1.0);
    spectrum.pole.push_back(corner * corner);
    spectrum.weight.push_back(weight);
    if (corner_hz >= highest_hz) return;
    if (corner_hz >= nyquist_parts_max * 0.5 / sample_period_s) {
      // All from here on are flat up to the Nyquist frequency, and their states one and the same.
      spectrum.weight.back() *= pole_ratio / (pole_ratio - 1.0);
      return;
    }
  }
}

void add_rise(const SensorNoise& noise, double sample_period_s, RationalSpectrum& spectrum) {
  if (noise.rise_asd == 0.0) return;
  const double angle_per_hz = 2.0 * std::numbers::pi * sample_period_s;
  const double corner = angle_per_hz * noise.rise_corner_hz;
  const double level = (noise.rise_asd / noise.white_asd) * (noise.rise_asd / noise.white_asd) /
                       (corner * corner * corner * corner);
  spectrum.has_rise = true;
  if (noise.rise_limit_hz == 0.0) {
    spectrum.u = 9.5;
    spectrum.v = 12.0;
    spectrum.rise = level * 9.5 * 12.0;
  } else {
    const double limit = angle_per_hz * noise.rise_limit_hz;
    spectrum.u = Complex(0.0, limit * limit);
    spectrum.v = conjugate(spectrum.u);
    spectrum.rise = level * limit * limit * limit * limit;
  }
}

/// Numerator polynomial of the spectrum at x.
Complex numerator(const RationalSpectrum& spectrum, Complex x) {
  Complex denominators = 1.0;
  for (const double pole : spectrum.pole) denominators = denominators * (x + pole);
  Complex sum = denominators;
  for (std::size_t i = 0; i < spectrum.pole.size(); ++i) {
    Complex term = spectrum.weight[i];
    for (std::size_t j = 0; j < spectrum.pole.size(); ++j) {
      if (j != i) term = term * (x + spectrum.pole[j]);
    }
    sum += term;
  }
  if (!spectrum.has_rise) return sum;
  return sum * (x - spectrum.u) * (x - spectrum.v) + spectrum.rise * x * x * denominators;
}

/// Zeros of the spectrum by the simultaneous iteration of [Durand1960], from the places where they
/// would be if 1/f and rise did not overlap.
std::vector<Complex> spectrum_zeros(const RationalSpectrum& spectrum) {
  std::vector<Complex> zeros;
  for (const double pole : spectrum.pole) zeros.emplace_back(-3.0 * pole, 0.1 * pole);
  if (spectrum.has_rise) {
    const double radius = std::sqrt((spectrum.u * spectrum.v).real() / (spectrum.rise + 1.0));
    zeros.push_back(radius * Complex(0.1, 1.0));
    zeros.push_back(radius * Complex(0.1, -1.1));
  }
  const double leading = 1.0 + spectrum.rise;
  for (int iteration = 0; iteration < 200; ++iteration) {
    double largest_move = 0.0;
    for (std::size_t i = 0; i < zeros.size(); ++i) {
      Complex move = numerator(spectrum, zeros[i]) / leading;
      for (std::size_t j = 0; j < zeros.size(); ++j) {
        if (j != i) move = move / (zeros[i] - zeros[j]);
      }
      zeros[i] = zeros[i] - move;
      largest_move = std::max(largest_move, norm(move) / norm(zeros[i]));
    }
    if (largest_move < 1e-28) return zeros;
  }
  throw InvalidArgument("noise: no filter found for the spectrum");
}

/// Principal square root. The C library's own may differ in the last bit from machine to machine.
Complex square_root(Complex x) {
  const double modulus = std::sqrt(norm(x));
  const double large = std::sqrt(0.5 * (modulus + std::abs(x.real())));
  if (large == 0.0) return 0.0;
  const double small = 0.5 * std::abs(x.imag()) / large;
  const double real = x.real() >= 0.0 ? large : small;
  const double imaginary = x.real() >= 0.0 ? small : large;
  return {real, x.imag() < 0.0 ? -imaginary : imaginary};
}

/// 1 − z for the root |z| < 1 of z + 1/z = 2 − x, without cancellation for small x.
Complex inside_distance(Complex x) {
  const Complex u = 0.5 * x;
  const Complex root = square_root(u * u - x);
  const Complex one = root + u;
  const Complex other = u - root;
  return norm(1.0 - one) <= 1.0 ? one : other;
}

struct ZerosAndPoles {
  std::vector<Complex> zero, pole;  ///< In z; poles: real ones first.
  double gain = 0.0;
};

ZerosAndPoles factorise(const RationalSpectrum& spectrum) {
  // |1 − z₀z⁻¹|² = z₀(x − x₀), so gain² collects the leading coefficient and the products of z₀.
  ZerosAndPoles filter;
  Complex gain_squared = 1.0 + spectrum.rise;
  for (const Complex x : spectrum_zeros(spectrum)) {
    filter.zero.push_back(1.0 - inside_distance(x));
    gain_squared = gain_squared / filter.zero.back();
  }
  for (const double x : spectrum.pole) filter.pole.push_back(1.0 - inside_distance(-x));
  if (spectrum.has_rise) {
    filter.pole.push_back(1.0 - inside_distance(spectrum.u));
    filter.pole.push_back(1.0 - inside_distance(spectrum.v));
  }
  for (const Complex pole : filter.pole) gain_squared = gain_squared * pole;
  filter.gain = std::sqrt(gain_squared.real());
  return filter;
}

/// c in H(z) = gain + Σ c z⁻¹/(1 − p z⁻¹).
Complex partial_fraction(const ZerosAndPoles& filter, std::size_t i) {
  const Complex p = filter.pole[i];
  Complex c = filter.gain;
  for (std::size_t j = 0; j < filter.pole.size(); ++j) {
    c = c * (p - filter.zero[j]);
    if (j != i) c = c / (p - filter.pole[j]);
  }
  return c;
}

/// Covariance of the states, each driven by the same white sequence: E[sᵢ sⱼ] = 1/(1 − pᵢpⱼ).
Eigen::MatrixXd stationary_covariance(const NoiseShape& shape) {
  const auto n = static_cast<Eigen::Index>(shape.num_states());
  const auto num_real = static_cast<Eigen::Index>(shape.num_real);
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < num_real; ++i) {
    const double p = shape.pole[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j < num_real; ++j) {
      covariance(i, j) = 1.0 / (1.0 - p * shape.pole[static_cast<std::size_t>(j)]);
    }
    if (!shape.has_pair) continue;
    const Complex mixed = 1.0 / (1.0 - p * shape.pair_pole);
    covariance(i, num_real) = covariance(num_real, i) = mixed.real();
    covariance(i, num_real + 1) = covariance(num_real + 1, i) = mixed.imag();
  }
  if (shape.has_pair) {
    const Complex square = 1.0 / (1.0 - shape.pair_pole * shape.pair_pole);  // E[S²]
    const double modulus = 1.0 / (1.0 - norm(shape.pair_pole));              // E[|S|²]
    covariance(num_real, num_real) = 0.5 * (modulus + square.real());
    covariance(num_real + 1, num_real + 1) = 0.5 * (modulus - square.real());
    covariance(num_real, num_real + 1) = covariance(num_real + 1, num_real) = 0.5 * square.imag();
  }
  return covariance;
}

void set_start_factor(NoiseShape& shape) {
  if (shape.num_states() == 0) return;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(stationary_covariance(shape));
  PROOFMASS_EXPECT(cholesky.info() == Eigen::Success);
  const Eigen::MatrixXd factor = cholesky.matrixL();
  for (Eigen::Index i = 0; i < factor.rows(); ++i) {
    for (Eigen::Index j = 0; j < factor.cols(); ++j) shape.start_factor.push_back(factor(i, j));
  }
}

}  // namespace

double nominal_psd(const SensorNoise& noise, double frequency_hz) {
  const auto fourth = [](double x) { return x * x * x * x; };
  const double white =
      noise.white_asd * noise.white_asd * (1.0 + noise.pink_corner_hz / frequency_hz);
  const double limit =
      noise.rise_limit_hz == 0.0 ? 1.0 : 1.0 + fourth(frequency_hz / noise.rise_limit_hz);
  const double rise =
      noise.rise_asd * noise.rise_asd * fourth(frequency_hz / noise.rise_corner_hz) / limit;
  return white + rise;
}

NoiseShape shape_noise(const SensorNoise& noise, double sample_period_s) {
  RationalSpectrum spectrum;
  add_pink(noise, sample_period_s, spectrum);
  add_rise(noise, sample_period_s, spectrum);
  const ZerosAndPoles filter = factorise(spectrum);
  PROOFMASS_EXPECT(filter.pole.size() <= NoiseShape::num_poles_max);

  // A one-sided density white² spread over [0, 1/2T] is the variance white²/(2T) of each sample.
  const double deviation = noise.white_asd / std::sqrt(2.0 * sample_period_s);
  NoiseShape shape;
  shape.gain = deviation * filter.gain;
  for (std::size_t i = 0; i < filter.pole.size(); ++i) {
    const Complex coefficient = deviation * partial_fraction(filter, i);
    if (filter.pole[i].imag() == 0.0) {
      shape.pole[shape.num_real] = filter.pole[i].real();
      shape.coefficient[shape.num_real] = coefficient.real();
      ++shape.num_real;
    } else if (!shape.has_pair) {  // Its conjugate says the same.
      shape.has_pair = true;
      shape.pair_pole = filter.pole[i];
      shape.pair_coefficient = coefficient;
    }
  }
  set_start_factor(shape);
  return shape;
}

double NoiseShape::psd(double frequency_hz, double sample_period_s) const {
  const auto [sine, cosine] = sincos_turns(frequency_hz * sample_period_s);
  const Complex delay(cosine, -sine);  // z⁻¹
  Complex response = gain;
  for (std::size_t i = 0; i < num_real; ++i) {
    response += coefficient[i] * delay / (1.0 - pole[i] * delay);
  }
  if (has_pair) {
    response += pair_coefficient * delay / (1.0 - pair_pole * delay) +
                conjugate(pair_coefficient) * delay / (1.0 - conjugate(pair_pole) * delay);
  }
  return norm(response) * 2.0 * sample_period_s;
}

}  // namespace proofmass
