#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/random/stream.hpp"
#include "core/statistics/sensitivity.hpp"
#include "core/statistics/stop_rule.hpp"

namespace proofmass::test {

/// Which column of test values: the same selection gives the same values everywhere.
struct Selection {
  std::uint64_t seed = 1;
  std::uint64_t repetition = 0;
  std::uint32_t column = 0;
};

/// `count` values of transform(u), u uniform on (0, 1).
template <typename Transform>
std::vector<double> column_of(std::size_t count, const Selection& selection, Transform transform) {
  const RandomStream stream(selection.seed, RunIndex{selection.repetition}, selection.column);
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = transform(uniform(stream.block(static_cast<std::uint32_t>(i))));
  }
  return values;
}

inline std::vector<double> uniform_column(std::size_t count, const Selection& selection) {
  return column_of(count, selection, [](double u) { return u; });
}

inline std::vector<double> normal_column(std::size_t count, const Selection& selection) {
  return column_of(count, selection, [](double u) { return inverse_normal(u); });
}

/// |x| of a normal x: the law of an absolute error.
inline std::vector<double> half_normal_column(std::size_t count, const Selection& selection) {
  return column_of(count, selection, [](double u) { return std::abs(inverse_normal(u)); });
}

/// second − first, pair by pair.
inline std::vector<double> differences_of(std::span<const double> first,
                                          std::span<const double> second) {
  std::vector<double> differences;
  for (std::size_t i = 0; i < first.size(); ++i) differences.push_back(second[i] - first[i]);
  return differences;
}

/// That of sensitivities() of one input and one output; empty if one of them does not vary.
inline std::optional<FirstOrderIndex> first_order_index(const Column& input, const Column& output,
                                                        double confidence) {
  const auto all = sensitivities({&input, 1}, {&output, 1}, confidence, 1);
  if (all[0].empty()) return std::nullopt;
  return all[0][0].first_order;
}

}  // namespace proofmass::test
