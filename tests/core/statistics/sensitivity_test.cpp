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

void expect_index(const std::optional<FirstOrderIndex>& found, double expected) {
  EXPECT_NEAR(found->index, expected, 5.0 * found->standard_error);
  EXPECT_LT(found->standard_error, 0.03);
}

// y = Σ cᵢ uᵢ: the indices are cᵢ²/Σc².
TEST(FirstOrderIndex, OfALinearFunctionIsItsShareOfTheVariance) {
  const Columns u = uniform_columns(3, 10'000, 41);
  const auto y =
      evaluated(u, [&](std::size_t i) { return 3.0 * u[0][i] - 2.0 * u[1][i] + u[2][i]; });
  expect_index(test::first_order_index(u[0], y, 0.95), 9.0 / 14.0);
  expect_index(test::first_order_index(u[1], y, 0.95), 4.0 / 14.0);
  expect_index(test::first_order_index(u[2], y, 0.95), 1.0 / 14.0);
}

// Ishigami's function with a = 7, b = 0.1 on (−π, π)³: V₁ = ½(1 + bπ⁴/5)², V₂ = a²/8, V₃ = 0 though
// x₃ matters together with x₁, and V = ½ + a²/8 + bπ⁴/5 + b²π⁸/18 [IshigamiHomma1990].
TEST(FirstOrderIndex, OfIshigamisFunctionIsTheKnownOne) {
  const Columns u = uniform_columns(3, 20'000, 42);
  const auto angle = [&](std::size_t k, std::size_t i) {
    return std::numbers::pi * (2.0 * u[k][i] - 1.0);
  };
  const auto y = evaluated(u, [&](std::size_t i) {
    const double s = std::sin(angle(1, i));
    return std::sin(angle(0, i)) * (1.0 + 0.1 * std::pow(angle(2, i), 4)) + 7.0 * s * s;
  });
  const double fourth = std::pow(std::numbers::pi, 4);
  const double first = 0.5 * std::pow(1.0 + 0.1 * fourth / 5.0, 2);
  const double second = 49.0 / 8.0;
  const double all = 0.5 + second + 0.1 * fourth / 5.0 + 0.01 * fourth * fourth / 18.0;
  expect_index(test::first_order_index(u[0], y, 0.95), first / all);
  expect_index(test::first_order_index(u[1], y, 0.95), second / all);
  expect_index(test::first_order_index(u[2], y, 0.95), 0.0);
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

// Values 1 to 4 in bins of four along the input, ranks 1 to 16: mean ranks 2.5, 6.5, 10.5 and 14.5
// deviate by 6, 2, 2 and 6 from 8.5. H = 12/(16·17) · 4·(36 + 4 + 4 + 36) = 14.1176; with three
// degrees of freedom the law of χ² has erfc(√(H/2)) + √(2H/π) exp(−H/2) beyond.
TEST(FirstOrderIndex, HasThePValueOfKruskalAndWallis) {
  std::vector<double> x;
  for (int i = 1; i <= 16; ++i) x.push_back(i);
  const double h = 12.0 / (16.0 * 17.0) * 4.0 * 80.0;
  const double beyond =
      std::erfc(std::sqrt(0.5 * h)) + std::sqrt(2.0 * h / std::numbers::pi) * std::exp(-0.5 * h);
  EXPECT_NEAR(test::first_order_index(x, x, 0.95)->p_value, beyond, 1e-12);
}

// Unrelated inputs: a p-value below 5 % in 5 % of 1000 cases, standard error 0.7 %; mean 0,
// standard deviation 1/√n.
TEST(FirstOrderIndex, OfAnUnrelatedInputIsNoise) {
  int num_below = 0;
  double sum = 0.0;
  for (std::uint64_t repetition = 0; repetition < 1000; ++repetition) {
    const auto x = test::uniform_column(200, {.seed = 43, .repetition = repetition, .column = 0});
    const auto y = test::normal_column(200, {.seed = 43, .repetition = repetition, .column = 1});
    const auto found = test::first_order_index(x, y, 0.95);
    if (found->p_value < 0.05) ++num_below;
    sum += found->index;
  }
  EXPECT_NEAR(num_below, 50, 28);
  EXPECT_NEAR(sum / 1000.0, 0.0, 4.0 / std::sqrt(200.0 * 1000.0));
}

// The scatter of the estimate over 400 campaigns is what its standard error says; that of a
// deviation from 400 is 3.5 %, and 15 % allow four of them.
TEST(FirstOrderIndex, KnowsItsStandardError) {
  std::vector<double> indices;
  double claimed = 0.0;
  for (std::uint64_t repetition = 0; repetition < 400; ++repetition) {
    const auto x = test::uniform_column(400, {.seed = 44, .repetition = repetition, .column = 0});
    auto y = test::uniform_column(400, {.seed = 44, .repetition = repetition, .column = 1});
    for (std::size_t i = 0; i < y.size(); ++i) y[i] += x[i];
    const auto found = test::first_order_index(x, y, 0.95);
    indices.push_back(found->index);
    claimed += found->standard_error / 400.0;
  }
  EXPECT_NEAR(moments(indices).standard_deviation / claimed, 1.0, 0.15);
  EXPECT_NEAR(moments(indices).mean, 0.5, 0.005);
}

TEST(FirstOrderIndex, NeedsValuesThatVary) {
  const auto x = test::uniform_column(16, {.seed = 45});
  EXPECT_TRUE(test::first_order_index(x, x, 0.95).has_value());
  EXPECT_FALSE(test::first_order_index(x, std::vector<double>(16, 1.0), 0.95).has_value());
  EXPECT_FALSE(test::first_order_index(std::vector<double>(16, 1.0), x, 0.95).has_value());
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
  const auto all = sensitivities(input_columns_, output_columns_, 0.95);
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
  const auto all = sensitivities(input_columns_, output_columns_, 0.9);
  const Sensitivity& first = all[0][0];
  EXPECT_EQ(first.rank_correlation, rank_correlation(inputs_[1], outputs_[0]));
  const auto index = test::first_order_index(inputs_[1], outputs_[0], 0.9);
  EXPECT_EQ(first.first_order.index, index->index);
  EXPECT_EQ(first.first_order.interval.lower, index->interval.lower);
  EXPECT_EQ(first.first_order.p_value, index->p_value);
}

// The magnitude is even in its driver: no correlation sees it, the index does.
TEST_F(SensitivitiesOfAnError, FindTheDriverOfAMagnitude) {
  const auto all = sensitivities(input_columns_, output_columns_, 0.95);
  EXPECT_EQ(all[1][0].input, 1u);
  EXPECT_GT(all[1][0].first_order.index, 0.7);
  EXPECT_LT(std::abs(all[1][0].rank_correlation), 0.1);
}

TEST_F(SensitivitiesOfAnError, RefuseColumnsThatDoNotFit) {
  const std::vector<double> few(10, 1.0);
  EXPECT_EQ(test::message_of<InvalidArgument>(
                [&] { (void)sensitivities(std::vector<Column>{few}, output_columns_, 0.95); }),
            "input = 10 values (must be as many as the others, 2000)");
  EXPECT_EQ(test::message_of<InvalidArgument>([&] {
              (void)sensitivities(std::vector<Column>{few}, std::vector<Column>{few}, 0.95);
            }),
            "output = 10 values (must be at least 16)");
}

}  // namespace
}  // namespace proofmass
