#include "core/statistics/sensitivity.hpp"

#include "core/error.hpp"
#include "core/statistics/correlation.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

using Columns = std::vector<std::vector<double>>;

Columns uniform_columns(std::size_t count, std::size_t num_values, std::uint64_t seed) {
  Columns columns;
  for (std::uint32_t i = 0; i < count; ++i) {
    columns.push_back(test::uniform_column(num_values, {.seed = seed, .column = i}));
  }
  return columns;
}

template <typename Function>
std::vector<double> evaluated(const Columns& inputs, Function function) {
  std::vector<double> output;
  for (std::size_t i = 0; i < inputs.front().size(); ++i) output.push_back(function(i));
  return output;
}

// y = x on a grid of n: neighbours differ by 2/n, half the square is 2/n². With the ends, which
// count half as much again, all n make 2/n² on average, and Var(x) = (n + 1)/(3 n) with n − 1.
TEST(FirstOrderIndex, LeavesOutTheSquareOfTheSpacingOnly) {
  constexpr double n = 100;
  std::vector<double> x, square;
  for (int i = 0; i < static_cast<int>(n); ++i) {
    x.push_back((2.0 * i + 1.0) / n - 1.0);
    square.push_back(x.back() * x.back());
  }
  EXPECT_NEAR(test::first_order_index(x, x, 0.95)->index, 1.0 - 2.0 / (n * n) * 3.0 * n / (n + 1.0),
              1e-12);
  EXPECT_NEAR(test::first_order_index(x, square, 0.95)->index, 1.0, 0.003);
}

TEST(FirstOrderIndex, NeedsValuesThatVary) {
  const auto x = test::uniform_column(16, {.seed = 45});
  EXPECT_TRUE(test::first_order_index(x, x, 0.95).has_value());
  EXPECT_FALSE(test::first_order_index(x, std::vector<double>(16, 1.0), 0.95).has_value());
  EXPECT_FALSE(test::first_order_index(std::vector<double>(16, 1.0), x, 0.95).has_value());
}

/// 1 in a share of the runs, else 0; in a hundredth of them 2, if `has_third`.
std::vector<double> levels(double share, std::uint64_t seed, bool has_third) {
  return test::column_of(1000, {.seed = seed}, [=](double u) {
    return has_third && u > 0.99 ? 2.0 : (u < share ? 1.0 : 0.0);
  });
}

// In ten of 1,000 runs a switch is thrown, and the ten worst magnitudes are those.
TEST(FirstOrderIndex, TakesALevelOfAnInputForItself) {
  const std::vector<double> noise = test::normal_column(1000, {.seed = 47});
  for (const bool has_third : {false, true}) {
    const std::vector<double> thrown = levels(0.01, 48, has_third);
    std::vector<double> magnitudes;
    for (std::size_t i = 0; i < noise.size(); ++i) {
      magnitudes.push_back(std::abs(noise[i]) + (thrown[i] == 1.0 ? 100.0 : 0.0));
    }
    const FirstOrderIndex found = *test::first_order_index(thrown, magnitudes, 0.95);
    EXPECT_LT(found.p_value, 1e-6) << has_third;
    // Of |x| of a normal x the variance is 1 − 2/π.
    const double share = 0.01 * 0.99 * 1e4;
    EXPECT_NEAR(found.index, share / (share + 1.0 - 2.0 / std::numbers::pi), 2e-3) << has_third;
  }
}

// 2,000 inputs of two and three levels, one of them rare, without influence: 5 % ± 3 · 0.5 %.
TEST(FirstOrderIndex, OfLevelsWithoutInfluenceIsRarelyFound) {
  const std::vector<double> noise = test::normal_column(1000, {.seed = 49});
  int num_found = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const std::vector<double> input = levels(i % 4 < 2 ? 0.01 : 0.3, 100 + i, i % 2 == 1);
    if (test::first_order_index(input, noise, 0.95)->p_value < 0.05) ++num_found;
  }
  EXPECT_GE(num_found, 70);
  EXPECT_LE(num_found, 130);
}

// Drawn: three quantities and a fixed one. Outputs: an error, its magnitude, a constant.
class SensitivitiesOfAnError : public testing::Test {
 protected:
  SensitivitiesOfAnError() : inputs_(uniform_columns(3, 2000, 46)) {
    inputs_.emplace_back(2000, 0.5);
    const auto error = evaluated(
        inputs_, [&](std::size_t i) { return 4.0 * (inputs_[1][i] - 0.5) + inputs_[2][i] - 0.5; });
    outputs_ = {error, error, std::vector<double>(2000, 1.0)};
    for (double& value : outputs_[1]) value = std::abs(value);
    for (const auto& column : inputs_) input_columns_.emplace_back(column);
    for (const auto& column : outputs_) output_columns_.emplace_back(column);
  }

  Columns inputs_, outputs_;
  std::vector<Column> input_columns_, output_columns_;
};

TEST_F(SensitivitiesOfAnError, AreRankedByTheirIndex) {
  const auto all = sensitivities(input_columns_, output_columns_, 0.95, 1);
  ASSERT_EQ(all.size(), 3u);
  ASSERT_EQ(all[0].size(), 3u);  // The fixed input explains nothing.
  EXPECT_EQ(all[0][0].input, 1u);
  EXPECT_EQ(all[0][1].input, 2u);
  EXPECT_EQ(all[0][2].input, 0u);
  EXPECT_LT(all[0][2].first_order.index, 0.08);
  EXPECT_GT(all[0][2].adjusted_p_value, 0.05);
  EXPECT_EQ(all[0][1].adjusted_p_value, 2.0 * all[0][1].first_order.p_value);
  EXPECT_TRUE(all[2].empty());
}

TEST_F(SensitivitiesOfAnError, AreThoseOfTheSingleFunctions) {
  const auto all = sensitivities(input_columns_, output_columns_, 0.9, 1);
  const Sensitivity& first = all[0][0];
  EXPECT_EQ(first.rank_correlation, rank_correlation(inputs_[1], outputs_[0]));
  const auto index = test::first_order_index(inputs_[1], outputs_[0], 0.9);
  EXPECT_EQ(first.first_order.index, index->index);
  EXPECT_EQ(first.first_order.interval.lower, index->interval.lower);
  EXPECT_EQ(first.first_order.p_value, index->p_value);
}

// The magnitude is even in its driver: no correlation sees it, the index does.
TEST_F(SensitivitiesOfAnError, FindTheDriverOfAMagnitude) {
  const auto all = sensitivities(input_columns_, output_columns_, 0.95, 1);
  EXPECT_EQ(all[1][0].input, 1u);
  EXPECT_GT(all[1][0].first_order.index, 0.7);
  EXPECT_LT(std::abs(all[1][0].rank_correlation), 0.1);
}

TEST_F(SensitivitiesOfAnError, RefuseColumnsThatDoNotFit) {
  const std::vector<double> few(10, 1.0);
  EXPECT_EQ(test::message_of<InvalidArgument>(
                [&] { (void)sensitivities(std::vector<Column>{few}, output_columns_, 0.95, 1); }),
            "input = 10 values (must be as many as the others, 2000)");
  EXPECT_EQ(test::message_of<InvalidArgument>([&] {
              (void)sensitivities(std::vector<Column>{few}, std::vector<Column>{few}, 0.95, 1);
            }),
            "output = 10 values (must be at least 16)");
}

}  // namespace
}  // namespace proofmass
