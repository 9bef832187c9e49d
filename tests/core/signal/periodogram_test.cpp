#include "core/signal/periodogram.hpp"

#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr double quarter_s = 0.25;

std::vector<double> sine(std::size_t num_samples, double turns_in_record, double amplitude) {
  std::vector<double> record;
  for (std::size_t k = 0; k < num_samples; ++k) {
    const double turns =
        turns_in_record * static_cast<double>(k) / static_cast<double>(num_samples);
    record.push_back(amplitude * std::sin(2.0 * std::numbers::pi * turns + 0.3));
  }
  return record;
}

// The Hann window's transform is N/2 at a bin's own frequency, −N/4 beside it and 0 elsewhere; its
// squares add up to 3N/8. A sine of amplitude A therefore has 2T (A/2)² (N/2)² / (3N/8) = A²NT/3.
TEST(HannPeriodogram, ShowsASineAtABinInThreeBins) {
  constexpr std::size_t num_samples = 600;
  const Periodogram periodogram = hann_periodogram(sine(num_samples, 17.0, 3.0), quarter_s);
  EXPECT_DOUBLE_EQ(periodogram.duration_s, 150.0);
  ASSERT_EQ(periodogram.psd.size(), num_samples / 2 + 1);
  const double height = 9.0 * 150.0 / 3.0;
  for (std::size_t bin = 0; bin < periodogram.psd.size(); ++bin) {
    const double part = bin == 17 ? 1.0 : (bin == 16 || bin == 18) ? 0.25 : 0.0;
    EXPECT_NEAR(periodogram.psd[bin], part * height, 1e-9 * height) << bin;
  }
}

// The mean over K bins has the relative standard error √((1 + 2(4/9 + 1/36))/K); four are allowed.
TEST(HannPeriodogram, LiesOnTheDensityOfWhiteNoise) {
  constexpr std::size_t num_samples = 65536;
  constexpr double sigma = 0.7;
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal(0.0, sigma);
  std::vector<double> record(num_samples);
  for (double& value : record) value = normal(generator);
  const std::vector<double> psd = hann_periodogram(record, quarter_s).psd;
  double sum = 0.0, count = 0.0;
  for (std::size_t bin = 3; bin + 3 < psd.size(); ++bin, count += 1.0) sum += psd[bin];
  EXPECT_NEAR(sum / count / (2.0 * sigma * sigma * quarter_s), 1.0, 4.0 * std::sqrt(1.945 / count));
}

TEST(HannPeriodogram, KnowsNothingOfTheMean) {
  std::vector<double> record = sine(360, 17.0, 3.0);
  const std::vector<double> without = hann_periodogram(record, quarter_s).psd;
  for (double& value : record) value += 1000.0;
  const std::vector<double> with = hann_periodogram(record, quarter_s).psd;
  for (std::size_t bin = 0; bin < with.size(); ++bin) EXPECT_NEAR(with[bin], without[bin], 1e-9);
}

bool is_product_of_2_3_and_5(std::size_t number) {
  for (const std::size_t prime : {2U, 3U, 5U}) {
    while (number % prime == 0) number /= prime;
  }
  return number == 1;
}

TEST(TransformLength, IsTheLargestProductOf2And3And5) {
  std::size_t largest = 1;
  for (std::size_t number = 1; number < 3000; ++number) {
    if (is_product_of_2_3_and_5(number)) largest = number;
    ASSERT_EQ(transform_length(number), largest) << number;
  }
}

TEST(HannPeriodogram, LeavesTheLastSamplesOut) {
  const Periodogram periodogram = hann_periodogram(sine(7 * 97, 3.0, 1.0), quarter_s);
  EXPECT_DOUBLE_EQ(periodogram.duration_s, 675.0 * quarter_s);
}

}  // namespace
}  // namespace proofmass
