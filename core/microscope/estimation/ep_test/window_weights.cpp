#include "core/microscope/estimation/ep_test/window_weights.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include "core/error.hpp"

namespace proofmass {
namespace {

// Longer stretches have the ends of one of this length.
constexpr std::size_t longest_stretch = 32;

// What a memory leaves after num_near windows that is no longer worth its time.
constexpr double memory_min = 1e-6;

constexpr std::size_t window_size = 2 * test_block_size;

/// Σₖ wₖ wₖ₊ₙ of a window's weights.
std::array<double, window_size> weight_products() {
  std::array<double, window_size> weight{}, products{};
  for (std::size_t k = 0; k < test_block_size; ++k) {
    constexpr auto size = static_cast<double>(test_block_size);
    weight[k] = weight[window_size - 1 - k] = (static_cast<double>(k) + 0.5) / (size * size);
  }
  for (std::size_t n = 0; n < window_size; ++n) {
    for (std::size_t k = 0; k + n < window_size; ++k) products[n] += weight[k] * weight[k + n];
  }
  return products;
}

/// amplitude·poleⁿ: a part of the autocovariance of a filter's output at n ≥ 1 samples.
struct Part {
  ComplexDouble amplitude, pole;
};

struct Parts {
  std::vector<Part> parts;  ///< Those of real poles first.
  double variance = 0.0;
};

/// y = gain·w + Σ cᵢ sᵢ has the autocovariance Σᵢ pᵢⁿ cᵢ (gain/pᵢ + Σⱼ cⱼ/(1 − pᵢpⱼ)).
Parts parts_of(const NoiseFilter& filter) {
  std::vector<ComplexDouble> pole, coefficient;
  for (std::size_t i = 0; i < filter.num_real; ++i) {
    pole.emplace_back(filter.pole[i]);
    coefficient.emplace_back(filter.coefficient[i]);
  }
  if (filter.has_pair) {
    pole.insert(pole.end(), {filter.pair_pole, conjugate(filter.pair_pole)});
    coefficient.insert(coefficient.end(),
                       {filter.pair_coefficient, conjugate(filter.pair_coefficient)});
  }
  Parts found;
  ComplexDouble variance = filter.gain * filter.gain;
  for (std::size_t i = 0; i < pole.size(); ++i) {
    ComplexDouble sum = 0.0;
    for (std::size_t j = 0; j < pole.size(); ++j) {
      sum += coefficient[j] / (1.0 - pole[i] * pole[j]);
    }
    variance += coefficient[i] * sum;
    found.parts.push_back({coefficient[i] * (filter.gain / pole[i] + sum), pole[i]});
  }
  found.variance = variance.real();
  return found;
}

ComplexDouble power(ComplexDouble base, std::size_t exponent) {
  ComplexDouble result = 1.0;
  for (std::size_t i = 0; i < exponent; ++i) result = result * base;
  return result;
}

}  // namespace

WindowAutocovariance::WindowAutocovariance(const NoiseFilter& sensor) {
  const Parts parts = parts_of(sensor);
  std::array<double, num_near * test_block_size + window_size> of_samples{};
  of_samples[0] = parts.variance;
  for (const auto& [amplitude, pole] : parts.parts) {
    ComplexDouble value = amplitude;
    for (std::size_t n = 1; n < of_samples.size(); ++n) {
      value = value * pole;
      of_samples[n] += value.real();
    }
  }
  const std::array<double, window_size> products = weight_products();
  for (std::size_t k = 0; k < num_near; ++k) {
    const std::size_t distance = k * test_block_size;
    near[k] = 0.5 * products[0] * of_samples[distance];
    for (std::size_t n = 1; n < window_size; ++n) {
      const std::size_t before = n < distance ? distance - n : n - distance;
      near[k] += 0.5 * products[n] * (of_samples[distance + n] + of_samples[before]);
    }
  }
  for (const auto& [amplitude, pole] : parts.parts) {
    const ComplexDouble factor = power(pole, test_block_size);
    if (norm(power(factor, num_near)) < memory_min * memory_min) continue;
    ComplexDouble gain = products[0];
    for (std::size_t n = 1; n < window_size; ++n) {
      gain += products[n] * (power(pole, n) + 1.0 / power(pole, n));
    }
    memory.push_back({0.5 * amplitude * gain, factor});
    for (std::size_t k = 0; k < num_near; ++k) {
      near[k] -= (memory.back().weight * power(factor, k)).real();
    }
  }
}

double WindowAutocovariance::at(std::size_t distance) const {
  double sum = distance < num_near ? near[distance] : 0.0;
  for (const auto& [weight, factor] : memory) sum += (weight * power(factor, distance)).real();
  return sum;
}

double WindowAutocovariance::sum() const {
  double total = near[0];
  for (std::size_t n = 1; n < near.size(); ++n) total += 2.0 * near[n];
  for (const auto& [weight, factor] : memory) {
    total += (weight * ((1.0 + factor) / (1.0 - factor))).real();
  }
  return total;
}

// 1/f noise is left out of the weights: over a stretch it is a constant, nearly, which they do not
// change.
WindowWeights::WindowWeights(const SensorNoise& sensor, double sample_period_s)
    : noise_(shape_noise(sensor, sample_period_s)) {
  SensorNoise without_pink = sensor;
  without_pink.pink_corner_hz = 0.0;
  const WindowAutocovariance local(shape_noise(without_pink, sample_period_s));
  const double total = local.sum();
  for (Eigen::Index length = 1; length <= Eigen::Index{longest_stretch}; ++length) {
    Eigen::MatrixXd covariance(length, length);
    for (Eigen::Index i = 0; i < length; ++i) {
      for (Eigen::Index j = 0; j < length; ++j) {
        covariance(i, j) = local.at(static_cast<std::size_t>(std::abs(i - j)));
      }
    }
    const Eigen::LLT<Eigen::MatrixXd> factored(covariance);
    // Rounding alone makes it indefinite; other weights than the best are less sharp, and no less
    // true.
    const Eigen::VectorXd best =
        factored.info() == Eigen::Success
            ? Eigen::VectorXd(factored.solve(Eigen::VectorXd::Constant(length, total)))
            : Eigen::VectorXd::Ones(length);
    auto& half = of_stretches_.emplace_back();
    for (Eigen::Index i = 0; 2 * i < length; ++i) half.push_back(static_cast<float>(best[i]));
  }
}

std::vector<float> WindowWeights::of(const std::vector<bool>& lost_blocks) const {
  std::vector<float> weights(lost_blocks.empty() ? 0 : lost_blocks.size() - 1);
  const auto is_lost = [&](std::size_t window) {
    return lost_blocks[window] || lost_blocks[window + 1];
  };
  for (std::size_t begin = 0; begin < weights.size(); ++begin) {
    std::size_t end = begin;
    while (end < weights.size() && !is_lost(end)) ++end;
    if (end == begin) continue;
    const auto& half = of_stretches_[std::min(end - begin, longest_stretch) - 1];
    for (std::size_t i = begin; i < end; ++i) {
      weights[i] = half[std::min({i - begin, end - 1 - i, half.size() - 1})];
    }
    begin = end;
  }
  return weights;
}

RegressorProducts WindowWeights::noise_products(
    std::span<const float> weights, std::span<const WindowRegressors> regressors) const {
  PROOFMASS_EXPECT(weights.size() == regressors.size());
  using Row = Eigen::Matrix<double, 1, num_test_regressors>;
  const auto powers_at = [&](std::size_t window) {
    const double time =
        2.0 * static_cast<double>(window + 1) / static_cast<double>(weights.size() + 1) - 1.0;
    return Eigen::Vector4d(1.0, time, time * time, time * time * time);
  };
  const auto row_of = [&](std::size_t window) {
    return Row(Eigen::Map<const Row>(regressors[window].data()));
  };
  Eigen::Matrix4d powers = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, num_test_regressors> mixed;
  mixed.setZero();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] == 0.0F) continue;
    const Eigen::Vector4d at = double{weights[i]} * powers_at(i);
    powers += at * powers_at(i).transpose();
    mixed += at * row_of(i);
  }
  const Eigen::Matrix<double, 4, num_test_regressors> polynomial = powers.llt().solve(mixed);

  // A product of two windows counts once from each side: half of it is summed, from the later one.
  struct Remembered {
    Row real = Row::Zero(), imaginary = Row::Zero();
  };
  std::array<Row, WindowAutocovariance::num_near> before;
  before.fill(Row::Zero());
  std::vector<Remembered> remembered(noise_.memory.size());
  Eigen::Matrix<double, num_test_regressors, num_test_regressors> sum;
  sum.setZero();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    Row& now = before[i % before.size()];
    now = double{weights[i]} * (row_of(i) - powers_at(i).transpose() * polynomial);
    Row noise = 0.5 * noise_.at(0) * now;
    for (std::size_t n = 1; n < before.size(); ++n) {
      noise += noise_.near[n] * before[(i + before.size() - n) % before.size()];
    }
    for (std::size_t m = 0; m < remembered.size(); ++m) {
      const auto& [weight, factor] = noise_.memory[m];
      auto& [real, imaginary] = remembered[m];
      noise += weight.real() * real - weight.imag() * imaginary;
      const Row sum_of_real = real + now;
      real = factor.real() * sum_of_real - factor.imag() * imaginary;
      imaginary = factor.real() * imaginary + factor.imag() * sum_of_real;
    }
    sum += now.transpose() * noise;
  }
  RegressorProducts products;
  for (Eigen::Index i = 0; i < sum.rows(); ++i) {
    for (Eigen::Index j = 0; j < sum.cols(); ++j) {
      products[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = sum(i, j) + sum(j, i);
    }
  }
  return products;
}

}  // namespace proofmass
