#include "coordinator/report/error_bins.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

namespace proofmass::coordinator {
namespace {

using ::testing::ElementsAre;

std::uint64_t sum_of(const std::vector<std::uint64_t>& counts) {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

/// How many values are in [lower, upper), counted one by one.
std::uint64_t count_between(const std::vector<double>& values, double lower, double upper) {
  return static_cast<std::uint64_t>(
      std::ranges::count_if(values, [&](double value) { return value >= lower && value < upper; }));
}

std::vector<double> normal_values(std::size_t count, double sigma) {
  std::mt19937_64 bits(7);
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    double sum = -6.0;  // Of twelve uniform ones: nearly normal, the same on every machine.
    for (int term = 0; term < 12; ++term) sum += static_cast<double>(bits() >> 11) * 0x1p-53;
    values.push_back(sigma * sum);
  }
  return values;
}

TEST(ErrorBins, CountEachValueBetweenItsEdges) {
  const std::vector<double> values = normal_values(5000, 3e-4);
  ErrorBins bins;
  for (const double value : values) bins.add(value);
  const Histogram histogram = bins.histogram();
  ASSERT_EQ(histogram.edges.size(), histogram.counts.size() + 1);
  EXPECT_LE(histogram.counts.size(), 64U);
  EXPECT_GE(histogram.counts.size(), 20U);
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    EXPECT_EQ(histogram.counts[i],
              count_between(values, histogram.edges[i], histogram.edges[i + 1]));
  }
  EXPECT_EQ(sum_of(histogram.counts), values.size());
}

TEST(ErrorBins, DoNotDependOnTheOrder) {
  std::vector<double> values = normal_values(1000, 1.0);
  ErrorBins forwards, backwards;
  for (const double value : values) forwards.add(value);
  std::ranges::reverse(values);
  for (const double value : values) backwards.add(value);
  EXPECT_EQ(forwards.histogram().edges, backwards.histogram().edges);
  EXPECT_EQ(forwards.histogram().counts, backwards.histogram().counts);
}

TEST(ErrorBins, HoldZerosAndTheLargestValues) {
  ErrorBins bins;
  EXPECT_TRUE(bins.histogram().counts.empty());
  bins.add(0.0);
  bins.add(-1e90);
  bins.add(1e90);
  EXPECT_EQ(sum_of(bins.histogram().counts), 3U);
}

// Ten bins a power of ten: 1, 2 and 5 are in the bins from 10^0, 10^0.3 and 10^0.6 on.
TEST(MagnitudeBins, AreTenAPowerOfTen) {
  MagnitudeBins bins;
  for (const double value : {1.0001, 2.1, 5.1, 5.2}) bins.add(value);
  const Histogram histogram = bins.histogram();
  EXPECT_THAT(histogram.counts, ElementsAre(1, 0, 0, 1, 0, 0, 0, 2));
  EXPECT_NEAR(histogram.edges.front(), 1.0, 1e-12);
  EXPECT_NEAR(histogram.edges.back(), std::pow(10.0, 0.8), 1e-9);
}

TEST(MagnitudeBins, LeaveOutOnePercentAtMost) {
  MagnitudeBins bins;
  bins.add(0.0);
  for (int i = 0; i < 199; ++i) bins.add(1.5);
  const Histogram histogram = bins.histogram();
  EXPECT_EQ(histogram.num_below, 1U);
  EXPECT_THAT(histogram.counts, ElementsAre(199));
}

TEST(MagnitudeBins, ShowTenPercent) {
  MagnitudeBins bins;
  for (int i = 0; i < 90; ++i) bins.add(1.5);
  for (int i = 0; i < 10; ++i) bins.add(0.75);
  EXPECT_THAT(bins.histogram().counts, ElementsAre(10, 0, 0, 90));
}

}  // namespace
}  // namespace proofmass::coordinator
