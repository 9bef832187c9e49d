#include "core/signal/line_weights.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace proofmass {
namespace {

using ::testing::HasSubstr;

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double period_s = 0.25;

/// Cosine and sine amplitude of each fit line, as the weights give them.
std::vector<double> weighted_amplitudes(const LineWeights& weights,
                                        const std::vector<double>& record) {
  const std::size_t num_outputs = 2 * weights.num_fit_lines();
  std::vector<double> block_weights(LineWeights::block_size * num_outputs);
  std::vector<double> sums(num_outputs, 0.0);
  std::size_t k = 0;
  WeightReader reader(weights);
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    reader.fill_block(block, block_weights);
    for (std::size_t j = 0; j < weights.samples_in(block); ++j, ++k) {
      for (std::size_t i = 0; i < num_outputs; ++i) {
        sums[i] += block_weights[j * num_outputs + i] * record[k];
      }
    }
  }
  EXPECT_EQ(k, record.size());
  return sums;
}

/// The same by the procedure itself: remove the mean, filter forwards, drop the transient, solve
/// the least squares of all lines by a QR decomposition.
std::vector<double> fitted_amplitudes(const LineFit& fit, const std::vector<double>& record) {
  double mean = 0.0;
  for (const double x : record) mean += x / static_cast<double>(record.size());
  std::vector<double> lines = fit.fit_hz;
  lines.insert(lines.end(), fit.known_hz.begin(), fit.known_hz.end());

  const auto num_kept = static_cast<Eigen::Index>(fit.num_samples - fit.num_dropped);
  Eigen::MatrixXd design(num_kept, static_cast<Eigen::Index>(2 * lines.size()));
  Eigen::VectorXd filtered(num_kept);
  BandPassState state;
  for (std::size_t k = 0; k < record.size(); ++k) {
    const double y = state.advance(fit.filter, record[k] - mean);
    if (k < fit.num_dropped) continue;
    const auto row = static_cast<Eigen::Index>(k - fit.num_dropped);
    filtered[row] = y;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const double angle = two_pi * lines[i] * fit.sample_period_s * static_cast<double>(k);
      design(row, static_cast<Eigen::Index>(2 * i)) = std::cos(angle);
      design(row, static_cast<Eigen::Index>(2 * i + 1)) = std::sin(angle);
    }
  }
  const Eigen::VectorXd solution = design.colPivHouseholderQr().solve(filtered);
  return {solution.data(), solution.data() + 2 * fit.fit_hz.size()};
}

/// A constant, three sines off and on the lines, and white noise; peak about 5.
std::vector<double> mixed_record(std::size_t num_samples, double line_hz) {
  std::mt19937_64 bits(77);
  std::vector<double> record;
  for (std::size_t k = 0; k < num_samples; ++k) {
    const double t = period_s * static_cast<double>(k);
    const double noise = static_cast<double>(bits() >> 11) * 0x1p-52 - 1.0;
    record.push_back(0.7 + noise + std::sin(two_pi * line_hz * t + 0.3) +
                     0.5 * std::cos(two_pi * 1.37 * line_hz * t) +
                     2.0 * std::sin(two_pi * 0.41 * line_hz * t));
  }
  return record;
}

LineFit line_fit(std::size_t num_samples, std::size_t num_dropped, double line_hz) {
  return {.num_samples = num_samples,
          .num_dropped = num_dropped,
          .sample_period_s = period_s,
          .filter = band_pass(line_hz / 3.0, line_hz * 3.0, period_s),
          .fit_hz = {line_hz},
          .known_hz = {}};
}

// Both ways sum 1e4 products of order one; the recursion's rounding, amplified by the filter's slow
// poles (corner 0.003 Hz), stays below 1e-11 of the record's scale.
void expect_same_estimate(const LineFit& fit) {
  const std::vector<double> record = mixed_record(fit.num_samples, fit.fit_hz.front());
  const std::vector<double> expected = fitted_amplitudes(fit, record);
  const std::vector<double> actual = weighted_amplitudes(LineWeights(fit), record);
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(actual[i], expected[i], 1e-10) << "output " << i << " of " << fit.num_samples;
  }
}

TEST(LineWeights, GiveTheEstimateOfTheProcedureForAnyLength) {
  constexpr std::size_t size = LineWeights::block_size;
  for (const std::size_t num_samples : {size - 1, size, size + 1, 3 * size, 3 * size + 517}) {
    LineFit fit = line_fit(num_samples, 400, 9.88e-3);
    fit.known_hz = {4.2e-3, 1.9e-2};
    expect_same_estimate(fit);
  }
}

// More blocks than the states that are kept.
TEST(LineWeights, GiveTheEstimateOfTheProcedureForManyBlocks) {
  LineFit fit = line_fit(260 * LineWeights::block_size + 517, 400, 9.88e-3);
  fit.known_hz = {4.2e-3, 1.9e-2};
  expect_same_estimate(fit);
}

TEST(LineWeights, GiveTheEstimateOfTheProcedureForAnyTransient) {
  for (const std::size_t num_dropped : {0U, 1U, 2047U, 2048U, 2049U, 5000U}) {
    LineFit fit = line_fit(9000, num_dropped, 9.88e-3);
    fit.known_hz = {4.2e-3, 1.9e-2};
    expect_same_estimate(fit);
  }
}

TEST(LineWeights, GiveTheEstimateOfTheProcedureForTwoLines) {
  LineFit fit = line_fit(20000, 4000, 9.88e-3);
  fit.fit_hz = {9.88e-3 + 3.36e-4, 9.88e-3 - 3.36e-4};
  fit.known_hz = {9.88e-3, 1.68e-4, 3.36e-4, 9.88e-3 + 1.68e-4, 9.88e-3 - 1.68e-4};
  // Lines a third of a turn apart in the kept record make the normal equations' condition 1e5.
  expect_same_estimate(fit);
}

// The two lowest lines of a session of two orbits, with the narrow filter that goes with them.
TEST(LineWeights, GiveTheEstimateOfTheProcedureAtTwiceTheOrbit) {
  const double orbital = 1.0 / 5950.0;
  LineFit fit = line_fit(47600, 4000, 2.0 * orbital);
  fit.known_hz = {orbital, 3.0 * orbital, 4.0 * orbital};
  expect_same_estimate(fit);
}

/// H(e^{iωT}) of a section.
std::complex<double> response(const Biquad& filter, double frequency_hz) {
  const std::complex<double> delay = std::polar(1.0, -two_pi * frequency_hz * period_s);
  return (filter.b0 + delay * (filter.b1 + delay * filter.b2)) /
         (1.0 + delay * (filter.a1 + delay * filter.a2));
}

std::complex<double> response(const BandPass& filter, double frequency_hz) {
  return response(filter.high_pass, frequency_hz) * response(filter.low_pass, frequency_hz);
}

std::vector<double> sine_record(std::size_t num_samples, double frequency_hz, double amplitude,
                                double phase) {
  std::vector<double> record;
  for (std::size_t k = 0; k < num_samples; ++k) {
    const double turns = frequency_hz * period_s * static_cast<double>(k);
    record.push_back(amplitude * std::cos(two_pi * turns + phase));
  }
  return record;
}

/// Amplitude A of Re(A e^{iωt}) from the amplitudes of cosine and sine.
std::complex<double> phasor(const std::vector<double>& amplitudes, std::size_t line) {
  return {amplitudes[2 * line], -amplitudes[2 * line + 1]};
}

// The transient decays as e^(−√½·2π·f/3·t), here e^−26 = 5e-12 over the 7000 samples dropped. The
// record holds a whole number of cycles, so its mean is 0.
TEST(LineWeights, PhasorOfASineIsTheFiltersGainTimesItsAmplitude) {
  constexpr double line_hz = 0.01;
  const LineFit fit = line_fit(24000, 7000, line_hz);
  const auto record = sine_record(fit.num_samples, line_hz, 3.0, 0.4);
  const std::complex<double> expected = response(fit.filter, line_hz) * std::polar(3.0, 0.4);
  const std::complex<double> actual = phasor(weighted_amplitudes(LineWeights(fit), record), 0);
  EXPECT_LT(std::abs(actual - expected), 1e-10);
}

// A record of so many blocks that their states are found in three steps; summed as it goes, for its
// 136 million samples. The frequency and its product with the time are each rounded by ε/2 at most,
// so that a phase after so many turns is known to ε of them.
TEST(LineWeights, PhasorOfASineIsTheFiltersGainAfterAYear) {
  constexpr double line_hz = 0.01;
  constexpr std::size_t num_turns = 340'000;
  const LineWeights weights(line_fit(400 * num_turns, 7000, line_hz));
  ASSERT_GT(weights.num_blocks(), 256U * 256U);
  WeightReader reader(weights);
  std::vector<double> values(2 * LineWeights::block_size);
  const std::vector<double> cycle = sine_record(400, line_hz, 3.0, 0.4);
  std::vector<double> sums(2, 0.0);
  std::size_t k = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    reader.fill_block(block, values);
    for (std::size_t j = 0; j < weights.samples_in(block); ++j, ++k) {
      for (std::size_t i = 0; i < 2; ++i) sums[i] += values[2 * j + i] * cycle[k % 400];
    }
  }
  const LineFit fit = line_fit(400, 0, line_hz);
  const std::complex<double> expected = response(fit.filter, line_hz) * std::polar(3.0, 0.4);
  const double phase_error_rad = std::numeric_limits<double>::epsilon() * two_pi * num_turns;
  EXPECT_LT(std::abs(phasor(sums, 0) - expected), phase_error_rad * std::abs(expected));
}

// Two lines, unequal gains; each line's phasor is that of its own sine.
TEST(LineWeights, TellTwoLinesApart) {
  LineFit fit = line_fit(24000, 7000, 0.01);
  fit.fit_hz = {0.01, 0.0125};
  auto record = sine_record(fit.num_samples, 0.01, 3.0, 0.4);
  const auto second = sine_record(fit.num_samples, 0.0125, 1000.0, -1.1);
  for (std::size_t k = 0; k < record.size(); ++k) record[k] += second[k];
  const auto amplitudes = weighted_amplitudes(LineWeights(fit), record);
  const auto expected_first = response(fit.filter, 0.01) * std::polar(3.0, 0.4);
  const auto expected_second = response(fit.filter, 0.0125) * std::polar(1000.0, -1.1);
  EXPECT_LT(std::abs(phasor(amplitudes, 0) - expected_first), 1e-10 * 1000.0);
  EXPECT_LT(std::abs(phasor(amplitudes, 1) - expected_second), 1e-10 * 1000.0);
}

// With either filter the ratio is 2 e^{0.9i}, although the gains differ.
TEST(LineWeights, RatioOfTwoSignalsIsFreeOfTheFiltersGain) {
  constexpr double line_hz = 0.01;
  for (const double ratio : {1.2, 3.0}) {
    LineFit fit = line_fit(24000, 7000, line_hz);
    fit.filter = band_pass(line_hz / ratio, line_hz * ratio, period_s);
    const LineWeights weights(fit);
    const auto one = sine_record(fit.num_samples, line_hz, 1.5, 0.2);
    const auto other = sine_record(fit.num_samples, line_hz, 3.0, 1.1);
    const auto quotient = phasor(weighted_amplitudes(weights, other), 0) /
                          phasor(weighted_amplitudes(weights, one), 0);
    EXPECT_LT(std::abs(quotient - std::polar(2.0, 0.9)), 1e-10) << ratio;
  }
}

TEST(LineWeights, GiveZeroForAConstant) {
  LineFit fit = line_fit(20011, 400, 9.88e-3);
  fit.known_hz = {4.2e-3};
  const std::vector<double> record(fit.num_samples, 1.0);
  for (const double amplitude : weighted_amplitudes(LineWeights(fit), record)) {
    EXPECT_NEAR(amplitude, 0.0, 1e-13);
  }
}

/// The weights of one block by a reader that has read nothing before.
std::vector<double> block_of(const LineWeights& weights, std::size_t block) {
  WeightReader reader(weights);
  std::vector<double> values(2 * LineWeights::block_size);
  reader.fill_block(block, values);
  values.resize(2 * weights.samples_in(block));
  return values;
}

TEST(LineWeights, AreTheSameBlockByBlockInAnyOrder) {
  const LineWeights weights(line_fit(700 * LineWeights::block_size + 5, 400, 9.88e-3));
  ASSERT_EQ(weights.num_blocks(), 701U);  // Three in a stretch.
  EXPECT_EQ(weights.samples_in(700), 5U);
  WeightReader reader(weights);
  std::vector<double> values(2 * LineWeights::block_size);
  for (const std::size_t block : {0U, 1U, 2U, 3U, 700U, 699U, 350U, 0U, 2U, 1U}) {
    reader.fill_block(block, values);
    const std::vector<double> alone = block_of(weights, block);
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), values.begin())) << block;
  }
}

std::string refusal(const LineFit& fit) {
  try {
    const LineWeights weights(fit);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(LineWeights, RefuseARecordShorterThanItsUnknowns) {
  LineFit fit = line_fit(103, 100, 0.3);
  fit.known_hz = {0.7};
  EXPECT_EQ(refusal(fit), "line fit: 3 samples kept of 103 are fewer than 4 unknowns");
  fit.num_dropped = 200;
  EXPECT_EQ(refusal(fit), "line fit: 0 samples kept of 103 are fewer than 4 unknowns");
}

TEST(LineWeights, AcceptAsManySamplesAsUnknowns) {
  LineFit fit = line_fit(104, 100, 0.3);
  fit.known_hz = {0.7};
  EXPECT_EQ(refusal(fit), "accepted");
}

TEST(LineWeights, RefuseLinesThatTheRecordCannotTellApart) {
  LineFit fit = line_fit(20000, 400, 9.88e-3);
  fit.known_hz = {9.88e-3};
  EXPECT_THAT(refusal(fit), HasSubstr("two lines are too close to be told apart in the record"));
  fit.known_hz = {9.88e-3 + 1e-10};
  EXPECT_THAT(refusal(fit), HasSubstr("two lines are too close to be told apart in the record"));
  fit.known_hz = {-9.88e-3};  // The mirror image is the same line.
  EXPECT_THAT(refusal(fit), HasSubstr("two lines are too close to be told apart in the record"));
}

}  // namespace
}  // namespace proofmass
