#include "core/campaign/law_moments.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/math/elementary.hpp"

namespace proofmass {
namespace {

/// Of the standard normal law on [from, to], by Simpson's rule about the peak of the density.
LawMoments truncated_moments(double from, double to) {
  // At a distance t from the peak p the density is exp(−t²/2 − |p| t) of that at the peak; what is
  // below exp(−40) of it is left out.
  constexpr double exponent_max = 40.0;
  const double peak = std::clamp(0.0, from, to);
  const double reach =
      2.0 * exponent_max / (std::abs(peak) + std::sqrt(peak * peak + 2.0 * exponent_max));
  const double first = std::max(from - peak, -reach), last = std::min(to - peak, reach);

  constexpr std::size_t num_steps = 1024;
  const double step = (last - first) / static_cast<double>(num_steps);
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i <= num_steps; ++i) {
    const double t = first + step * static_cast<double>(i);
    const double factor = i == 0 || i == num_steps ? 1.0 : (i % 2 == 0 ? 2.0 : 4.0);
    const double weight = factor * exponential(-t * (0.5 * t + peak));
    sum += weight;
    mean += weight * t;
    square += weight * t * t;
  }
  mean /= sum;
  return {peak + mean, std::sqrt(std::max(square / sum - mean * mean, 0.0))};
}

LawMoments discrete_moments(const Dispersion& law) {
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i < law.values.size(); ++i) {
    sum += law.probabilities[i];
    mean += law.probabilities[i] * law.values[i];
  }
  mean /= sum;
  for (std::size_t i = 0; i < law.values.size(); ++i) {
    const double distance = law.values[i] - mean;
    square += law.probabilities[i] * distance * distance;
  }
  return {mean, std::sqrt(square / sum)};
}

}  // namespace

std::optional<LawMoments> moments_of(const Dispersion& law) {
  switch (law.law) {
    case Law::uniform:
      return LawMoments{0.5 * (law.minimum + law.maximum),
                        (law.maximum - law.minimum) / std::sqrt(12.0)};
    case Law::normal:
    case Law::correlated:
      return LawMoments{law.mean, law.standard_deviation};
    case Law::truncated_normal:
    case Law::truncated: {
      const auto standard = truncated_moments((law.minimum - law.mean) / law.standard_deviation,
                                              (law.maximum - law.mean) / law.standard_deviation);
      return LawMoments{law.mean + law.standard_deviation * standard.mean,
                        law.standard_deviation * standard.standard_deviation};
    }
    case Law::fixed:
      return LawMoments{law.value, 0.0};
    case Law::discrete:
      return discrete_moments(law);
    case Law::table:
    case Law::derived:
      break;
  }
  return std::nullopt;
}

}  // namespace proofmass
