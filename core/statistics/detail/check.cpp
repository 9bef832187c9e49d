#include "core/statistics/detail/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.hpp"

namespace proofmass::detail {

void check_values(std::string_view name, std::span<const double> values, std::size_t num_min) {
  if (values.size() < num_min) {
    throw InvalidArgument(fmt::format("{} = {} {} (must be at least {})", name, values.size(),
                                      values.size() == 1 ? "value" : "values", num_min));
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) continue;
    throw InvalidArgument(fmt::format("{}[{}] = {} (must be finite)", name, i, values[i]));
  }
}

void check_same_size(std::string_view name, std::span<const double> values,
                     std::span<const double> others) {
  if (values.size() == others.size()) return;
  throw InvalidArgument(fmt::format("{} = {} values (must be as many as the others, {})", name,
                                    values.size(), others.size()));
}

bool varies(std::span<const double> values) {
  return std::ranges::any_of(values, [&](double value) { return value != values.front(); });
}

void check_fraction(std::string_view name, double value) {
  if (value > 0.0 && value < 1.0) return;
  throw InvalidArgument(fmt::format("{} = {} (must be in (0, 1))", name, value));
}

}  // namespace proofmass::detail
