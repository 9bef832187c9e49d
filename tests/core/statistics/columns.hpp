#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/random/normal.hpp"
#include "core/random/stream.hpp"

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

}  // namespace proofmass::test
