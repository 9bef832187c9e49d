#include "core/statistics/order.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "core/error.hpp"
#include "core/statistics/detail/check.hpp"

namespace proofmass {

std::vector<double> sorted(std::span<const double> values) {
  detail::check_values("values", values, 1);
  std::vector<double> ascending(values.begin(), values.end());
  std::sort(ascending.begin(), ascending.end());
  return ascending;
}

OrderPlace percentile_place(std::size_t count, double level) {
  if (!(level >= 0.0 && level <= 1.0)) {
    throw InvalidArgument(fmt::format("level = {} (must be in [0, 1])", level));
  }
  const double place = static_cast<double>(count - 1) * level;
  const auto below = static_cast<std::size_t>(place);
  if (below + 1 >= count) return {.from = count - 1, .to = count - 1, .weight = 0.0};
  return {.from = below, .to = below + 1, .weight = place - static_cast<double>(below)};
}

double percentile(std::span<const double> ascending, double level) {
  detail::check_values("values", ascending, 1);
  const OrderPlace place = percentile_place(ascending.size(), level);
  return place.between(ascending[place.from], ascending[place.to]);
}

std::vector<std::size_t> ascending_order(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return values[a] < values[b] || (values[a] == values[b] && a < b);
  });
  return order;
}

std::vector<double> average_ranks(std::span<const double> values) {
  detail::check_values("values", values, 1);
  const std::vector<std::size_t> order = ascending_order(values);
  std::vector<double> ranks(values.size());
  for (std::size_t first = 0; first < order.size();) {
    std::size_t end = first + 1;
    while (end < order.size() && values[order[end]] == values[order[first]]) ++end;
    // The mean of the ranks first + 1 to end.
    const double rank = 0.5 * static_cast<double>(first + 1 + end);
    for (; first < end; ++first) ranks[order[first]] = rank;
  }
  return ranks;
}

}  // namespace proofmass
