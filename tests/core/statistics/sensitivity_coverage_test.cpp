#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include "core/statistics/sensitivity.hpp"
#include "tests/core/statistics/columns.hpp"

namespace proofmass {
namespace {

using Columns = std::vector<std::vector<double>>;

/// A function of uniform inputs whose first-order indices are known.
struct Law {
  std::string name;
  std::vector<double> indices;  ///< Of the inputs.
  std::function<double(const std::vector<double>& u)> output;
};

// a = 7, b = 0.1 on (−π, π)³ [IshigamiHomma1990].
Law ishigami() {
  const double fourth = std::pow(std::numbers::pi, 4);
  const double first = 0.5 * std::pow(1.0 + 0.1 * fourth / 5.0, 2);
  const double second = 49.0 / 8.0;
  const double all = 0.5 + second + 0.1 * fourth / 5.0 + 0.01 * fourth * fourth / 18.0;
  return {"Ishigami", {first / all, second / all, 0.0}, [](const std::vector<double>& u) {
            std::array<double, 3> x{};
            for (std::size_t i = 0; i < 3; ++i) x[i] = std::numbers::pi * (2.0 * u[i] - 1.0);
            const double sine = std::sin(x[1]);
            return std::sin(x[0]) * (1.0 + 0.1 * std::pow(x[2], 4)) + 7.0 * sine * sine;
          }};
}

// Π (|4u − 2| + a)/(1 + a), a = 0, 1, 4.5, 9: Vᵢ = 1/(3(1 + aᵢ)²), V = Π(1 + Vᵢ) − 1.
Law sobol_g() {
  static constexpr std::array a{0.0, 1.0, 4.5, 9.0};
  double product = 1.0;
  std::vector<double> indices;
  for (const double one : a) {
    indices.push_back(1.0 / (3.0 * (1.0 + one) * (1.0 + one)));
    product *= 1.0 + indices.back();
  }
  for (double& index : indices) index /= product - 1.0;
  return {"Sobol g", indices, [](const std::vector<double>& u) {
            double value = 1.0;
            for (std::size_t i = 0; i < a.size(); ++i) {
              value *= (std::abs(4.0 * u[i] - 2.0) + a[i]) / (1.0 + a[i]);
            }
            return value;
          }};
}

Law linear() {
  return {"linear", {9.0 / 14.0, 4.0 / 14.0, 1.0 / 14.0}, [](const std::vector<double>& u) {
            return 3.0 * u[0] - 2.0 * u[1] + u[2];
          }};
}

struct Repetitions {
  std::size_t num_values;
  std::uint64_t count;
};

/// How often the 95 % interval holds each index, in per cent.
std::vector<double> coverage_of(const Law& law, const Repetitions& repetitions) {
  const std::size_t num_inputs = law.indices.size();
  std::vector<double> covered(num_inputs, 0.0);
  for (std::uint64_t repetition = 0; repetition < repetitions.count; ++repetition) {
    Columns inputs;
    for (std::uint32_t i = 0; i < num_inputs; ++i) {
      inputs.push_back(test::uniform_column(repetitions.num_values,
                                            {.seed = 61, .repetition = repetition, .column = i}));
    }
    std::vector<double> output, u(num_inputs);
    for (std::size_t run = 0; run < repetitions.num_values; ++run) {
      for (std::size_t i = 0; i < num_inputs; ++i) u[i] = inputs[i][run];
      output.push_back(law.output(u));
    }
    for (std::size_t i = 0; i < num_inputs; ++i) {
      const Interval interval = test::first_order_index(inputs[i], output, 0.95)->interval;
      if (interval.lower <= law.indices[i] && law.indices[i] <= interval.upper) covered[i] += 1.0;
    }
  }
  for (double& one : covered) one *= 100.0 / static_cast<double>(repetitions.count);
  return covered;
}

class Coverage : public testing::TestWithParam<Repetitions> {};

// A 95 % interval holds the index in 93 to 97 % of all campaigns. The standard error of a coverage
// of 95 % is √(95 · 5/repetitions): 0.34 %, 0.49 % and 0.80 %.
TEST_P(Coverage, OfAnIndexIsAsStated) {
  for (const Law& law : {ishigami(), sobol_g(), linear()}) {
    const std::vector<double> covered = coverage_of(law, GetParam());
    for (std::size_t i = 0; i < covered.size(); ++i) {
      std::cout << fmt::format("{} x{}, n = {}: {:.1f} %\n", law.name, i + 1, GetParam().num_values,
                               covered[i]);
      EXPECT_GE(covered[i], 93.0) << law.name << " x" << i + 1;
      EXPECT_LE(covered[i], 97.0) << law.name << " x" << i + 1;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(FirstOrderIndex, Coverage,
                         testing::Values(Repetitions{100, 4000}, Repetitions{500, 2000},
                                         Repetitions{4000, 750}),
                         [](const auto& tested) {
                           return "At" + std::to_string(tested.param.num_values);
                         });

// 70 inputs that do not matter, and an output as skew as the |error| of K2c: in 5 % of all
// campaigns at most one of them is called significant. Standard error of 400 repetitions: 1.1 %.
TEST(Sensitivities, OfUnrelatedInputsAreRarelyCalledSignificant) {
  constexpr std::uint64_t num_repetitions = 400;
  constexpr std::size_t num_values = 100;
  int num_found = 0, num_uncorrected = 0;
  for (std::uint64_t repetition = 0; repetition < num_repetitions; ++repetition) {
    Columns inputs;
    for (std::uint32_t i = 0; i < 72; ++i) {
      inputs.push_back(
          test::normal_column(num_values, {.seed = 62, .repetition = repetition, .column = i}));
    }
    std::vector<double> output = inputs[70];
    for (std::size_t i = 0; i < num_values; ++i) output[i] = std::abs(output[i] * inputs[71][i]);
    const std::vector<Column> columns(inputs.begin(), inputs.begin() + 70);
    const auto rows = sensitivities(columns, std::vector<Column>{output}, 0.95).front();
    const auto is_found = [](const Sensitivity& row) { return row.adjusted_p_value < 0.05; };
    const auto is_low = [](const Sensitivity& row) { return row.first_order.p_value < 0.05; };
    if (std::ranges::any_of(rows, is_found)) ++num_found;
    if (std::ranges::any_of(rows, is_low)) ++num_uncorrected;
  }
  std::cout << fmt::format("{} of {} campaigns, {} without correction\n", num_found,
                           num_repetitions, num_uncorrected);
  EXPECT_LE(num_found, 33);  // 20 and three standard errors.
  EXPECT_GT(num_uncorrected, 300);
}

}  // namespace
}  // namespace proofmass
