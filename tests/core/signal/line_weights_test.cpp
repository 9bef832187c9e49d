#include "core/signal/line_weights.hpp"

#include <Eigen/Dense>

#include "core/error.hpp"
#include "tests/support/constants.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

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

TEST(LineWeights, GiveTheEstimateOfTheProcedure) {
  constexpr std::size_t size = LineWeights::block_size;
  // The longest has more blocks than the states that are kept.
  for (const std::size_t num_samples :
       {size - 1, size, size + 1, 3 * size, 3 * size + 517, 260 * size + 517}) {
    LineFit fit = line_fit(num_samples, 400, 9.88e-3);
    fit.known_hz = {4.2e-3, 1.9e-2};
    expect_same_estimate(fit);
  }
  for (const std::size_t num_dropped : {0U, 1U, 2047U, 2048U, 2049U, 5000U}) {
    LineFit fit = line_fit(9000, num_dropped, 9.88e-3);
    fit.known_hz = {4.2e-3, 1.9e-2};
    expect_same_estimate(fit);
  }
  LineFit two_lines = line_fit(20000, 4000, 9.88e-3);
  two_lines.fit_hz = {9.88e-3 + 3.36e-4, 9.88e-3 - 3.36e-4};
  two_lines.known_hz = {9.88e-3, 1.68e-4, 3.36e-4, 9.88e-3 + 1.68e-4, 9.88e-3 - 1.68e-4};
  // Lines a third of a turn apart in the kept record make the normal equations' condition 1e5.
  expect_same_estimate(two_lines);
  // The two lowest lines of a session of two orbits, with the narrow filter that goes with them.
  const double orbital = 1.0 / 5950.0;
  LineFit lowest = line_fit(47600, 4000, 2.0 * orbital);
  lowest.known_hz = {orbital, 3.0 * orbital, 4.0 * orbital};
  expect_same_estimate(lowest);
}

// A record of so many blocks that their states are found in three steps; summed as it goes, for its
// 136 million samples. The frequency and its product with the time are each rounded by ε/2 at most,
// so that a phase after so many turns is known to ε of them. The transient decays to e^−26 within
// the 7000 samples that are dropped.
TEST(LineWeights, PhasorOfASineIsTheFiltersGainAfterAYear) {
  constexpr double line_hz = 0.01;
  constexpr std::size_t num_turns = 340'000, samples_per_turn = 400;
  const LineFit fit = line_fit(samples_per_turn * num_turns, 7000, line_hz);
  const LineWeights weights(fit);
  ASSERT_GT(weights.num_blocks(), 256U * 256U);
  std::vector<double> turn;
  for (std::size_t k = 0; k < samples_per_turn; ++k) {
    turn.push_back(3.0 * std::cos(two_pi * static_cast<double>(k) / samples_per_turn + 0.4));
  }
  WeightReader reader(weights);
  std::vector<double> values(2 * LineWeights::block_size);
  double cosine = 0.0, sine = 0.0;
  std::size_t k = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    reader.fill_block(block, values);
    for (std::size_t j = 0; j < weights.samples_in(block); ++j, ++k) {
      cosine += values[2 * j] * turn[k % samples_per_turn];
      sine += values[2 * j + 1] * turn[k % samples_per_turn];
    }
  }
  const std::complex<double> expected =
      response(fit.filter, line_hz, period_s) * std::polar(3.0, 0.4);
  const double phase_error_rad = std::numeric_limits<double>::epsilon() * two_pi * num_turns;
  EXPECT_LT(std::abs(std::complex(cosine, -sine) - expected), phase_error_rad * std::abs(expected));
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
  return test::message_of<InvalidArgument>([&] { const LineWeights weights(fit); });
}

TEST(LineWeights, RefuseARecordShorterThanItsUnknowns) {
  LineFit fit = line_fit(103, 100, 0.3);
  fit.known_hz = {0.7};
  EXPECT_EQ(refusal(fit), "line fit: 3 samples kept of 103 are fewer than 4 unknowns");
  fit.num_dropped = 200;
  EXPECT_EQ(refusal(fit), "line fit: 0 samples kept of 103 are fewer than 4 unknowns");
  fit = line_fit(104, 100, 0.3);
  fit.known_hz = {0.7};
  EXPECT_EQ(refusal(fit), "") << "as many as unknowns";
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
