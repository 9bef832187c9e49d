#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <iostream>
#include <vector>

#include "core/error.hpp"
#include "core/statistics/sensitivity.hpp"
#include "tests/core/statistics/columns.hpp"
#include "tests/message_of.hpp"

namespace proofmass {
namespace {

using Columns = std::vector<std::vector<double>>;
using Values = std::vector<double>;

Columns normal_columns(std::uint32_t count, std::size_t num_values, const test::Selection& from) {
  Columns columns;
  for (std::uint32_t i = 0; i < count; ++i) {
    columns.push_back(test::normal_column(
        num_values, {.seed = from.seed, .repetition = from.repetition, .column = i}));
  }
  return columns;
}

Values output_of(const Columns& inputs, const std::function<double(std::size_t run)>& function) {
  Values output;
  for (std::size_t i = 0; i < inputs.front().size(); ++i) output.push_back(function(i));
  return output;
}

std::vector<ExplanatoryTerm> terms_of(const Columns& inputs, const Values& output,
                                      std::size_t num_max = 3) {
  const std::vector<Column> columns(inputs.begin(), inputs.end());
  return explanatory_terms(columns, output, num_max, 0.95);
}

// The error of K2c: −3.03 a_d11' K2d and 2 % of its variance beside, here normal. The slope has a
// standard error of 3.03 √(0.02/0.98/2000) = 0.01 for a product of variance 1.
TEST(ExplanatoryTerms, NameTheProductThatMakesAnError) {
  const Columns inputs = normal_columns(13, 2000, {.seed = 71});
  const double noise = 3.03 * std::sqrt(0.02 / 0.98);
  const auto output = output_of(inputs, [&](std::size_t i) {
    return -3.03 * inputs[4][i] * inputs[9][i] + noise * inputs[12][i];
  });
  const auto terms = terms_of({inputs.begin(), inputs.begin() + 12}, output);
  ASSERT_EQ(terms.size(), 1u);
  EXPECT_EQ(terms[0].first, 4u);
  EXPECT_EQ(terms[0].second, 9u);
  EXPECT_NEAR(terms[0].slope, -3.03, 0.05);
  EXPECT_NEAR(terms[0].share, 0.98, 0.005);
  EXPECT_LT(terms[0].p_value, 1e-9);
}

// Exact by construction, in units far from 1; the second quantity has a mean.
TEST(ExplanatoryTerms, FitAllTermsAtOnce) {
  Columns inputs = normal_columns(5, 400, {.seed = 72});
  for (double& value : inputs[1]) value = 1e-9 * (value + 3.0);
  for (double& value : inputs[3]) value *= 1e12;
  const auto output = output_of(inputs, [&](std::size_t i) {
    return 2.0 + 5e9 * inputs[1][i] - 4e-12 * inputs[0][i] * inputs[3][i] +
           1.5 * inputs[2][i] * inputs[2][i];
  });
  const auto terms = terms_of(inputs, output, 5);
  ASSERT_EQ(terms.size(), 3u);
  double share = 0.0;
  for (const ExplanatoryTerm& term : terms) {
    share += term.share;
    if (!term.second) {
      EXPECT_EQ(term.first, 1u);
      EXPECT_NEAR(term.slope, 5e9, 1.0);
    } else if (term.first == 2) {
      EXPECT_EQ(term.second, 2u);
      EXPECT_NEAR(term.slope, 1.5, 1e-9);
    } else {
      EXPECT_EQ(term.first, 0u);
      EXPECT_EQ(term.second, 3u);
      EXPECT_NEAR(term.slope, -4e-12, 1e-20);
    }
  }
  EXPECT_NEAR(share, 1.0, 1e-9);
}

// Scale factors near 1 times the driver correlate with the output as well as the driver does.
TEST(ExplanatoryTerms, AreNotProductsWithFactorsThatAddNothing) {
  Columns inputs = normal_columns(6, 500, {.seed = 73});
  for (std::size_t i = 2; i < 6; ++i) {
    for (double& value : inputs[i]) value = 1.0 + 1e-3 * value;
  }
  const auto output =
      output_of(inputs, [&](std::size_t i) { return 2.0 * inputs[0][i] + 0.5 * inputs[1][i]; });
  const auto terms = terms_of(inputs, output);
  ASSERT_EQ(terms.size(), 2u);
  EXPECT_EQ(terms[0].first, 0u);
  EXPECT_FALSE(terms[0].second.has_value());
  EXPECT_NEAR(terms[0].slope, 2.0, 1e-9);
  EXPECT_EQ(terms[1].first, 1u);
  EXPECT_FALSE(terms[1].second.has_value());
}

// The output's scatter goes with input 0 and its mean with nothing: the least squares' own test
// takes products with input 0 for terms. Standard error of 300 repetitions: 1.3 %.
TEST(ExplanatoryTerms, AreRarelyFoundWhereThereAreNone) {
  for (const std::size_t num_values : {std::size_t{50}, std::size_t{200}}) {
    int num_found = 0;
    for (std::uint64_t repetition = 0; repetition < 300; ++repetition) {
      const Columns inputs = normal_columns(31, num_values, {.seed = 74, .repetition = repetition});
      const auto output =
          output_of(inputs, [&](std::size_t i) { return inputs[0][i] * inputs[30][i]; });
      if (!terms_of({inputs.begin(), inputs.begin() + 30}, output, 1).empty()) ++num_found;
    }
    std::cout << fmt::format("n = {}: terms found in {} of 300\n", num_values, num_found);
    EXPECT_LE(num_found, 15 + 3 * 4);
  }
}

// 70 inputs and 100 runs: the product that makes 98 % of K2c's error is found among 2,555 terms.
TEST(ExplanatoryTerms, AreFoundInAHundredRuns) {
  int num_right = 0;
  for (std::uint64_t repetition = 0; repetition < 50; ++repetition) {
    const Columns inputs = normal_columns(71, 100, {.seed = 75, .repetition = repetition});
    const auto output = output_of(inputs, [&](std::size_t i) {
      return inputs[20][i] * inputs[60][i] + 0.14 * inputs[70][i];
    });
    const auto terms = terms_of({inputs.begin(), inputs.begin() + 70}, output, 1);
    if (terms.size() == 1 && terms[0].first == 20 && terms[0].second == 60) ++num_right;
  }
  EXPECT_GE(num_right, 48);
}

TEST(ExplanatoryTerms, OfAConstantAreNone) {
  const Columns inputs = normal_columns(3, 100, {.seed = 76});
  EXPECT_TRUE(terms_of(inputs, Values(100, 2.0)).empty());
  EXPECT_TRUE(terms_of({Values(100, 1.0)}, inputs[0]).empty());
}

TEST(ExplanatoryTerms, RefuseColumnsThatDoNotFit) {
  const Columns inputs = normal_columns(2, 100, {.seed = 77});
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)terms_of(inputs, Values(20, 1.0)); }),
            "input = 100 values (must be as many as the others, 20)");
  EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)terms_of(inputs, Values(3, 1.0)); }),
            "output = 3 values (must be at least 16)");
}

}  // namespace
}  // namespace proofmass
