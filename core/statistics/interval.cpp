#include "core/statistics/interval.hpp"

#include <algorithm>
#include <cmath>

#include "core/error.hpp"
#include "core/math/elementary.hpp"
#include "core/random/normal.hpp"
#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

/// A place between the values x₍rank₎ and x₍rank+1₎, counted from 1.
struct Place {
  std::size_t rank;
  double weight;  ///< Of the upper neighbour.
};

/// Largest r ≥ 1 with P(x₍r₎ ≤ percentile) = P(Bin(n, level) ≥ r) ≥ confidence; 0 if there is none.
std::size_t lower_rank(std::size_t n, double level, double confidence) {
  std::size_t holds = 0;
  std::size_t fails = n + 1;
  while (fails - holds > 1) {
    const std::size_t r = holds + (fails - holds) / 2;
    const double probability =
        binomial_at_least(static_cast<double>(r), static_cast<double>(n), level);
    (probability >= confidence ? holds : fails) = r;
  }
  return holds;
}

/// The probability left beyond each end of an interval, and what the interval is called.
struct Tail {
  double tail;
  double confidence;
};

Interval clopper_pearson(double num_hits, double num_runs, const Tail& beyond) {
  PROOFMASS_EXPECT(num_hits >= 0.0 && num_hits <= num_runs && num_runs > 0.0);
  const double misses = num_runs - num_hits;
  return {.lower = num_hits == 0.0 ? 0.0 : beta_quantile(beyond.tail, num_hits, misses + 1.0),
          .upper = misses == 0.0 ? 1.0 : beta_quantile(1.0 - beyond.tail, num_hits + 1.0, misses),
          .confidence = beyond.confidence};
}

// Lower bound of a percentile, one-sided. Of the r values below the percentile the nearest lies an
// exponential distance of rate r/level from it, of those above the nearest one of rate
// (n − r)/(1 − level); the weight makes P(bound ≤ percentile) = confidence under this law.
std::optional<Place> lower_place(std::size_t n, double level, double confidence) {
  const std::size_t rank = lower_rank(n, level, confidence);
  if (rank == 0) return std::nullopt;
  if (rank == n) return Place{n, 0.0};
  const auto r = static_cast<double>(rank);
  const auto count = static_cast<double>(n);
  const double too_much = binomial_at_least(r, count, level) - confidence;
  const double too_little = confidence - binomial_at_least(r + 1.0, count, level);
  const double below = r * (1.0 - level) * too_little;
  const double above = (count - r) * level * too_much;
  return Place{rank, above / (above + below)};
}

}  // namespace

std::optional<Interval> mean_interval(const Moments& moments, double confidence) {
  detail::check_fraction("confidence", confidence);
  if (moments.count < 2) return std::nullopt;
  const auto n = static_cast<double>(moments.count);
  const double quantile = student_quantile(0.5 + 0.5 * confidence, n - 1.0);
  const double half_width = quantile * moments.standard_deviation / std::sqrt(n);
  return Interval{moments.mean - half_width, moments.mean + half_width, confidence};
}

std::optional<Interval> deviation_interval(const Moments& moments, double confidence) {
  detail::check_fraction("confidence", confidence);
  const double z = inverse_normal(0.5 + 0.5 * confidence);
  const auto n = static_cast<double>(moments.count);
  if (n < 5.0 || n <= z) return std::nullopt;
  const double kurtosis = std::max(1.0, 3.0 + moments.excess_kurtosis);
  const double correction = n / (n - z);
  const double half_width =
      z * correction * std::sqrt((kurtosis - (n - 3.0) / n) / (n - 1.0));  // Of ln σ².
  const double centre = std::sqrt(correction) * moments.standard_deviation;
  return Interval{centre * exponential(-0.5 * half_width), centre * exponential(0.5 * half_width),
                  confidence};
}

std::optional<IntervalPlaces> percentile_interval_places(std::size_t n, double level,
                                                         double confidence) {
  detail::check_fraction("level", level);
  detail::check_fraction("confidence", confidence);
  const double one_sided = 0.5 + 0.5 * confidence;
  const std::optional<Place> from_below = lower_place(n, level, one_sided);
  // The upper bound is the lower one of the values turned round.
  const std::optional<Place> from_above = lower_place(n, 1.0 - level, one_sided);
  if (!from_below || !from_above) return std::nullopt;

  const std::size_t low = from_below->rank - 1;
  const std::size_t high = n - from_above->rank;
  return IntervalPlaces{
      .lower = {.from = low, .to = low + (low + 1 < n ? 1 : 0), .weight = from_below->weight},
      .upper = {.from = high, .to = high - (high > 0 ? 1 : 0), .weight = from_above->weight}};
}

std::optional<Interval> percentile_interval(std::span<const double> ascending, double level,
                                            double confidence) {
  const auto places = percentile_interval_places(ascending.size(), level, confidence);
  if (!places) return std::nullopt;
  const auto value_at = [&](const OrderPlace& place) {
    return place.between(ascending[place.from], ascending[place.to]);
  };
  return Interval{value_at(places->lower), value_at(places->upper), confidence};
}

Interval probability_interval(double num_hits, double num_runs, double confidence) {
  detail::check_fraction("confidence", confidence);
  const double tail = 0.5 - 0.5 * confidence;
  return clopper_pearson(num_hits, num_runs, {.tail = tail, .confidence = confidence});
}

Interval probability_bounds(double num_hits, double num_runs, double confidence) {
  detail::check_fraction("confidence", confidence);
  return clopper_pearson(num_hits, num_runs, {.tail = 1.0 - confidence, .confidence = confidence});
}

}  // namespace proofmass
