#include "core/campaign/sampling_design.hpp"

#include "core/random/sobol.hpp"
#include "core/random/stream.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/moments.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t design_seed = 7;
constexpr std::size_t num_dimensions = 60;
constexpr SamplingDesign latin{.kind = DesignKind::latin_hypercube, .points = 32};
constexpr SamplingDesign net{.kind = DesignKind::sobol, .points = 32};
constexpr SamplingDesign random_draws{};

std::uint64_t stratum(const SamplingDesign& design, std::size_t dimension, std::uint64_t run,
                      std::uint64_t of_seed = design_seed) {
  return stratum_of(design, dimension, of_seed, RunIndex{run}).index;
}

double coordinate(const SamplingDesign& design, std::size_t dimension, std::uint64_t run) {
  const RandomStream stream(design_seed, RunIndex{run},
                            stream_id("test/" + std::to_string(dimension)));
  return uniform_in(stratum_of(design, dimension, design_seed, RunIndex{run}), stream.block(0));
}

/// The multiples of 2⁻¹⁰ by the recurrence of [JoeKuo2008] Eq. (2), from a line of its table.
struct PublishedDimension {
  std::size_t dimension;  // From 1, as in the table.
  std::uint32_t degree, coefficients;
  std::vector<std::uint32_t> first;
};

std::uint32_t published_coordinate(std::uint32_t point, const PublishedDimension& of) {
  std::vector<std::uint32_t> m = of.first;
  const std::uint32_t s = of.degree;
  while (m.size() < sobol_bits) {
    const std::size_t k = m.size();
    std::uint32_t next = m[k - s] ^ (m[k - s] << s);
    for (std::uint32_t i = 1; i < s; ++i) {
      if ((of.coefficients >> (s - 1 - i) & 1U) != 0) next ^= m[k - i] << i;
    }
    m.push_back(next);
  }
  std::uint32_t sum = 0;
  for (std::uint32_t bit = 0; bit < sobol_bits; ++bit) {
    if ((point >> bit & 1U) != 0) sum ^= m[bit] << (sobol_bits - 1 - bit);
  }
  return sum;
}

TEST(Sobol, HasThePublishedDirectionNumbers) {
  const std::vector<PublishedDimension> table{{2, 1, 0, {1}},
                                              {3, 2, 1, {1, 3}},
                                              {4, 3, 1, {1, 3, 1}},
                                              {5, 3, 2, {1, 1, 1}},
                                              {6, 4, 1, {1, 1, 3, 3}},
                                              {7, 4, 4, {1, 3, 5, 13}},
                                              {8, 5, 2, {1, 1, 5, 5, 17}}};
  for (const PublishedDimension& of : table) {
    for (std::uint32_t point = 0; point < 1024; ++point) {
      ASSERT_EQ(sobol(point, of.dimension - 1), published_coordinate(point, of))
          << of.dimension << " " << point;
    }
  }
  for (std::uint32_t bit = 0; bit < sobol_bits; ++bit) {
    EXPECT_EQ(sobol(1U << bit, 0), 512U >> bit);  // Van der Corput's sequence.
  }
}

TEST(SamplingDesign, HasOnePointInEachStratumOfEachDimension) {
  for (const DesignKind kind : {DesignKind::latin_hypercube, DesignKind::sobol}) {
    for (const std::uint64_t points : {2U, 4U, 32U, 256U, 1024U, 7U, 100U}) {
      if (kind == DesignKind::sobol && !std::has_single_bit(points)) continue;
      const SamplingDesign design{.kind = kind, .points = points};
      const std::size_t step = points > 256 ? 20 : 1;
      for (std::size_t dimension = 0; dimension < num_dimensions; dimension += step) {
        for (const std::uint64_t replicate : {0U, 5U}) {
          std::set<std::uint64_t> strata;
          for (std::uint64_t i = 0; i < points; ++i) {
            strata.insert(stratum(design, dimension, replicate * points + i));
          }
          EXPECT_EQ(strata.size(), points);
          EXPECT_EQ(*strata.rbegin(), points - 1);
        }
      }
    }
  }
}

TEST(SamplingDesign, KeepsNumbersWithinTheirStratum) {
  constexpr std::uint32_t all = 0xffffffffU;
  for (const std::uint64_t count : {2U, 3U, 32U, 1000U, 1024U}) {
    for (const std::uint64_t index : {std::uint64_t{0}, count / 2, count - 1}) {
      const auto whole = static_cast<double>(count);
      for (const RandomBlock& block : {RandomBlock{}, RandomBlock{all, all, all, all}}) {
        const double number = uniform_in({.index = index, .count = count}, block);
        EXPECT_GT(number, static_cast<double>(index) / whole);
        EXPECT_LT(number, static_cast<double>(index + 1) / whole);
      }
    }
  }
}

TEST(SamplingDesign, LeavesIndependentDrawsAsTheyWere) {
  const RandomStream stream(design_seed, RunIndex{3}, 17);
  for (std::uint32_t i = 0; i < 100; ++i) {
    const double number =
        uniform_in(stratum_of(random_draws, 5, design_seed, RunIndex{3}), stream.block(i));
    EXPECT_EQ(std::bit_cast<std::uint64_t>(number),
              std::bit_cast<std::uint64_t>(uniform(stream.block(i))));
  }
}

/// Most points minus fewest in an elementary interval of 2ᵃ × 2ᵇ parts.
std::uint64_t unevenness(const std::vector<std::array<std::uint32_t, 2>>& points, int digits, int a,
                         int b) {
  std::map<std::uint32_t, std::uint64_t> counts;
  for (const auto& [x, y] : points) ++counts[(x >> (digits - a)) << b | y >> (digits - b)];
  std::uint64_t most = 0, fewest = counts.size() < 1U << (a + b) ? 0 : points.size();
  for (const auto& [part, count] : counts) {
    most = std::max(most, count);
    fewest = std::min(fewest, count);
  }
  return most - fewest;
}

/// The smallest t such that all elementary intervals of 2ᵗ⁻ᵐ hold 2ᵗ points each.
int quality_of(const std::vector<std::array<std::uint32_t, 2>>& points, int digits) {
  for (int t = 0; t < digits; ++t) {
    bool is_net = true;
    for (int a = 0; a <= digits - t; ++a) {
      is_net = is_net && unevenness(points, digits, a, digits - t - a) == 0;
    }
    if (is_net) return t;
  }
  return digits;
}

// Nested scrambling permutes elementary intervals, so that it leaves t as it is.
TEST(SamplingDesign, KeepsThePairsOfASobolNetAsEvenAsTheyAre) {
  constexpr int digits = 6;
  const SamplingDesign design{.kind = DesignKind::sobol, .points = 64};
  for (const auto& [first, second] :
       std::vector<std::array<std::size_t, 2>>{{0, 1}, {1, 2}, {3, 7}, {10, 40}, {58, 59}}) {
    std::vector<std::array<std::uint32_t, 2>> plain, scrambled;
    for (std::uint32_t i = 0; i < design.points; ++i) {
      plain.push_back(
          {sobol(i, first) >> (sobol_bits - digits), sobol(i, second) >> (sobol_bits - digits)});
      scrambled.push_back({static_cast<std::uint32_t>(stratum(design, first, 64 + i)),
                           static_cast<std::uint32_t>(stratum(design, second, 64 + i))});
    }
    EXPECT_NE(plain, scrambled);
    const int quality = quality_of(plain, digits);
    EXPECT_EQ(quality_of(scrambled, digits), quality);
    EXPECT_LT(quality, digits);
    if (second == 1) {
      EXPECT_EQ(quality, 0);  // The first two dimensions are a (0, m, 2)-net.
    }
  }
}

/// χ² of equally likely cells, as a number of its standard deviations beyond its mean.
double excess_of(const std::map<std::uint64_t, std::uint64_t>& counts, std::size_t num_cells) {
  double total = 0.0, squares = 0.0;
  for (const auto& [cell, count] : counts) {
    total += static_cast<double>(count);
    squares += static_cast<double>(count) * static_cast<double>(count);
  }
  const auto cells = static_cast<double>(num_cells);
  const double chi_square = squares * cells / total - total;
  return (chi_square - (cells - 1.0)) / std::sqrt(2.0 * (cells - 1.0));
}

// 20,000 replicates of 8 points; χ² at most four of its standard deviations above its mean.
TEST(SamplingDesign, RandomisesReplicatesPointsAndDimensionsIndependently) {
  for (const DesignKind kind : {DesignKind::latin_hypercube, DesignKind::sobol}) {
    const SamplingDesign design{.kind = kind, .points = 8};
    std::map<std::uint64_t, std::uint64_t> strata, dimensions, replicates, seeds, points;
    for (std::uint64_t replicate = 0; replicate < 20'000; ++replicate) {
      const std::uint64_t run = replicate * 8 + 3;
      const std::uint64_t own = stratum(design, 2, run);
      ++strata[own];
      ++dimensions[own * 8 + stratum(design, 3, run)];
      ++replicates[own * 8 + stratum(design, 2, run + 8)];
      ++seeds[own * 8 + stratum(design, 2, run, design_seed + 1)];
      ++points[own * 8 + stratum(design, 2, run - 1)];
    }
    EXPECT_LT(excess_of(strata, 8), 4.0);
    EXPECT_LT(excess_of(dimensions, 64), 4.0);
    EXPECT_LT(excess_of(replicates, 64), 4.0);
    EXPECT_LT(excess_of(seeds, 64), 4.0);
    // Two points have different strata. Those of points 2 and 3 of the net differ in the first
    // digit, and their further ones are independent.
    const std::size_t num_pairs = kind == DesignKind::sobol ? 2 * 4 * 4 : 8 * 7;
    EXPECT_THAT(points, SizeIs(num_pairs));
    EXPECT_LT(excess_of(points, num_pairs), 4.0);
  }
}

/// A function of some coordinates, with its closed-form mean.
struct KnownFunction {
  std::string name;
  double mean;
  double (*value)(const SamplingDesign&, std::uint64_t run);
};

double linear_law(const SamplingDesign& design, std::uint64_t run) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 6; ++i)
    sum += static_cast<double>(i + 1) * coordinate(design, i, run);
  return sum;
}

double ishigami(const SamplingDesign& design, std::uint64_t run) {
  std::array<double, 3> x{};
  for (std::size_t i = 0; i < 3; ++i) {
    x[i] = std::numbers::pi * (2.0 * coordinate(design, i + 10, run) - 1.0);
  }
  return std::sin(x[0]) + 7.0 * std::pow(std::sin(x[1]), 2) +
         0.1 * std::pow(x[2], 4) * std::sin(x[0]);
}

double sobol_g(const SamplingDesign& design, std::uint64_t run) {
  constexpr std::array a{0.0, 1.0, 4.5, 9.0, 99.0, 99.0};
  double product = 1.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    product *= (std::abs(4.0 * coordinate(design, i + 30, run) - 2.0) + a[i]) / (1.0 + a[i]);
  }
  return product;
}

/// |x + y - 1| > 0.8: a share of 4 %, of which 512 runs have some 20.
double is_in_corner(const SamplingDesign& design, std::uint64_t run) {
  const double sum = coordinate(design, 3, run) + coordinate(design, 4, run);
  return std::abs(sum - 1.0) > 0.8 ? 1.0 : 0.0;
}

/// Means of replicates of 32 points.
std::vector<double> replicate_means(const SamplingDesign& design, const KnownFunction& function,
                                    std::uint64_t num_replicates) {
  constexpr std::uint64_t points = 32;
  std::vector<double> means;
  for (std::uint64_t run = 0; run < num_replicates * points; run += points) {
    double sum = 0.0;
    for (std::uint64_t i = 0; i < points; ++i) sum += function.value(design, run + i);
    means.push_back(sum / static_cast<double>(points));
  }
  return means;
}

constexpr std::uint64_t repetitions = 500, replicates_each = 16;

double coverage(const std::vector<double>& means, double truth) {
  std::size_t num_covered = 0;
  for (std::size_t i = 0; i < means.size(); i += replicates_each) {
    const std::optional<Interval> interval =
        mean_interval(moments(std::span(means).subspan(i, replicates_each)), default_confidence);
    if (interval->lower <= truth && truth <= interval->upper) ++num_covered;
  }
  return static_cast<double>(num_covered) / static_cast<double>(repetitions);
}

// 500 intervals of 16 replicates: the standard error of their coverage is 1 %, that of the mean of
// all replicates 1/89 of one replicate's standard deviation.
TEST(SamplingDesign, HasHonestIntervalsFromReplicates) {
  const std::vector<KnownFunction> functions{{"linear law", 10.5, linear_law},
                                             {"Ishigami's function", 3.5, ishigami},
                                             {"Sobol's g", 1.0, sobol_g},
                                             {"share", 0.04, is_in_corner}};
  for (const KnownFunction& function : functions) {
    for (const SamplingDesign& design : {random_draws, latin, net}) {
      const std::vector<double> means =
          replicate_means(design, function, repetitions * replicates_each);
      const Moments of_all = moments(means);
      const double standard_error =
          of_all.standard_deviation / std::sqrt(static_cast<double>(means.size()));
      EXPECT_NEAR(of_all.mean, function.mean, 4.0 * standard_error)
          << function.name << " " << name_of(design.kind);
      EXPECT_NEAR(coverage(means, function.mean), 0.95, 0.04)
          << function.name << " " << name_of(design.kind);
    }
  }
}

}  // namespace
}  // namespace proofmass
