#include "core/statistics/comparison.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/order.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr int num_repetitions = 2000;

/// Share of repetitions, in per cent, whose interval contains the truth.
template <typename IntervalOf>
double coverage(double truth, const IntervalOf& interval_of) {
  int num_covering = 0;
  for (std::uint64_t i = 0; i < num_repetitions; ++i) {
    const std::optional<Interval> interval = interval_of(i);
    if (interval && interval->lower <= truth && truth <= interval->upper) ++num_covering;
  }
  return 100.0 * num_covering / num_repetitions;
}

// The standard error of a coverage from 2000 repetitions is 0.49 %: 1.5 % are three of it.
void expect_nominal(double percent) {
  EXPECT_GE(percent, 93.5);
  EXPECT_LE(percent, 96.5);
}

test::Selection selection(std::uint64_t repetition, std::uint32_t column = 0) {
  return {.seed = 95, .repetition = repetition, .column = column};
}

// √(2/π) is the mean of |x|.
TEST(IntervalCoverage, OfTheMeanOfMagnitudes) {
  for (const std::size_t n : {20u, 100u, 1000u}) {
    const double truth = std::sqrt(2.0 / std::numbers::pi);
    expect_nominal(coverage(truth, [&](std::uint64_t i) {
      return mean_interval(moments(test::half_normal_column(n, selection(i))), 0.95);
    }));
  }
}

/// Shares of repetitions for several laws of mean 0 or not, of deviation 1.
struct DeviationCoverage {
  double normal, uniform, magnitudes, exponential, product;
};

DeviationCoverage deviation_coverage(std::size_t n) {
  const auto of = [&](const auto& column) {
    return coverage(1.0,
                    [&](std::uint64_t i) { return deviation_interval(moments(column(i)), 0.95); });
  };
  const auto scaled = [](std::vector<double> values, double factor) {
    for (double& value : values) value *= factor;
    return values;
  };
  const auto normal = [&](std::uint64_t i, std::uint32_t column = 0) {
    return test::normal_column(n, selection(i, column));
  };
  return {.normal = of([&](std::uint64_t i) { return normal(i); }),
          .uniform = of([&](std::uint64_t i) {
            return scaled(test::uniform_column(n, selection(i)), std::sqrt(12.0));
          }),
          .magnitudes = of([&](std::uint64_t i) {
            return scaled(test::half_normal_column(n, selection(i)),
                          1.0 / std::sqrt(1.0 - 2.0 / std::numbers::pi));
          }),
          .exponential = of([&](std::uint64_t i) {
            std::vector<double> values = test::uniform_column(n, selection(i));
            for (double& value : values) value = -std::log1p(-value);
            return values;
          }),
          // The law of an error that is the product of two draws: excess kurtosis 6.
          .product = of([&](std::uint64_t i) {
            std::vector<double> values = normal(i);
            const std::vector<double> factors = normal(i, 1);
            for (std::size_t k = 0; k < n; ++k) values[k] *= factors[k];
            return values;
          })};
}

// The chi-square law, which is exact for normal values, covers 100 % for uniform ones, 89 % for
// magnitudes and 68 % for exponential values and products, however many they are.
TEST(IntervalCoverage, OfTheDeviationByTheKurtosis) {
  const DeviationCoverage few = deviation_coverage(20);
  expect_nominal(few.normal);
  EXPECT_GE(few.uniform, 92.0);
  EXPECT_GE(few.magnitudes, 90.5);
  EXPECT_GE(few.exponential, 83.0);
  EXPECT_GE(few.product, 86.5);
  const DeviationCoverage many = deviation_coverage(1000);
  expect_nominal(many.normal);
  expect_nominal(many.uniform);
  expect_nominal(many.magnitudes);
  EXPECT_GE(many.exponential, 92.5);
  EXPECT_GE(many.product, 92.5);
}

TEST(IntervalCoverage, OfTheDeviationByTheBootstrap) {
  expect_nominal(coverage(1.0, [](std::uint64_t i) {
    return bootstrap_deviation_interval(test::normal_column(200, selection(i)), 0.95);
  }));
  expect_nominal(coverage(std::sqrt(1.0 / 12.0), [](std::uint64_t i) {
    return bootstrap_deviation_interval(test::uniform_column(100, selection(i)), 0.95);
  }));
  expect_nominal(coverage(std::sqrt(1.0 - 2.0 / std::numbers::pi), [](std::uint64_t i) {
    return bootstrap_deviation_interval(test::half_normal_column(200, selection(i)), 0.95);
  }));
}

TEST(IntervalCoverage, OfPercentiles) {
  for (const std::size_t n : {20u, 100u, 1000u}) {
    const double median = inverse_normal(0.75);
    expect_nominal(coverage(median, [&](std::uint64_t i) {
      return percentile_interval(sorted(test::half_normal_column(n, selection(i))), 0.5, 0.95);
    }));
  }
  for (const double level : {0.9, 0.95}) {
    expect_nominal(coverage(inverse_normal(0.5 + 0.5 * level), [&](std::uint64_t i) {
      return percentile_interval(sorted(test::half_normal_column(100, selection(i))), level, 0.95);
    }));
  }
  expect_nominal(coverage(inverse_normal(0.995), [](std::uint64_t i) {
    return percentile_interval(sorted(test::half_normal_column(500, selection(i))), 0.99, 0.95);
  }));
}

// Discrete counts leave steps of 2 % with 500 runs, hence 5000.
TEST(IntervalCoverage, OfAProbability) {
  expect_nominal(coverage(0.2, [](std::uint64_t i) -> std::optional<Interval> {
    double num_hits = 0.0;
    for (const double u : test::uniform_column(5000, selection(i))) num_hits += u < 0.2 ? 1.0 : 0.0;
    return probability_interval(num_hits, 5000.0, 0.95);
  }));
}

// Welch's case: unequal counts, unequal deviations.
TEST(IntervalCoverage, OfTheDifferenceOfCampaigns) {
  expect_nominal(coverage(0.0, [](std::uint64_t i) {
    std::vector<double> second = test::normal_column(25, selection(i, 1));
    for (double& value : second) value *= 3.0;
    return compare_unpaired(test::normal_column(60, selection(i, 0)), second, 0.95).interval;
  }));
}

// One error in 50 is 1, all others are 0. Welch's interval alone covers 33 %: two in three of the
// small campaigns have no such error, no scatter, and seem sure of their mean.
TEST(IntervalCoverage, OfTheDifferenceOfCampaignsWithRareErrors) {
  const auto errors = [](std::size_t count, const test::Selection& of) {
    return test::column_of(count, of, [](double u) { return u < 0.02 ? 1.0 : 0.0; });
  };
  EXPECT_GE(coverage(0.0,
                     [&](std::uint64_t i) {
                       return compare_unpaired(errors(20, selection(i, 0)),
                                               errors(1000, selection(i, 1)), 0.95)
                           .interval;
                     }),
            93.5);
}

}  // namespace
}  // namespace proofmass
