#include "core/statistics/tolerance.hpp"

#include <algorithm>
#include <functional>
#include <vector>

#include "core/statistics/detail/check.hpp"
#include "core/statistics/distribution.hpp"

namespace proofmass {
namespace {

// With probability P(Bin(n, coverage) ≤ n − order) at least `order` values lie above the
// percentile, so that the value of this order is a bound.
bool is_bound(const Tolerance& tolerance, std::uint64_t num_runs, std::uint64_t order) {
  const double doubt = binomial_at_most(static_cast<double>(order) - 1.0,
                                        static_cast<double>(num_runs), 1.0 - tolerance.coverage);
  return order <= num_runs && tolerance.is_shown(doubt);
}

}  // namespace

void Tolerance::validate() const {
  detail::check_fraction("coverage", coverage);
  detail::check_fraction("confidence", confidence);
}

std::uint64_t wilks_order(const Tolerance& tolerance, std::uint64_t num_runs) {
  tolerance.validate();
  std::uint64_t holds = 0;
  std::uint64_t fails = num_runs + 1;
  while (fails - holds > 1) {
    const std::uint64_t middle = holds + (fails - holds) / 2;
    (is_bound(tolerance, num_runs, middle) ? holds : fails) = middle;
  }
  return holds;
}

std::optional<ToleranceBound> wilks_upper(std::span<const double> values,
                                          const Tolerance& tolerance, std::uint64_t num_unknown) {
  return upper_bound_of_order(values, wilks_order(tolerance, values.size() + num_unknown),
                              num_unknown);
}

std::optional<ToleranceBound> upper_bound_of_order(std::span<const double> values,
                                                   std::uint64_t order, std::uint64_t num_unknown) {
  detail::check_values("values", values, 0);
  if (order <= num_unknown) return std::nullopt;
  std::vector<double> descending(values.begin(), values.end());
  const auto place = descending.begin() + static_cast<std::ptrdiff_t>(order - num_unknown - 1);
  std::nth_element(descending.begin(), place, descending.end(), std::greater<>());
  const auto first = std::find(values.begin(), values.end(), *place);
  return ToleranceBound{*place, order, static_cast<std::size_t>(first - values.begin())};
}

}  // namespace proofmass
