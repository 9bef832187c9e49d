#include "core/campaign/run_result.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "core/error.hpp"

namespace proofmass {

std::string_view name_at(const std::vector<std::string_view>& names, std::uint32_t position) {
  PROOFMASS_EXPECT(position <= names.size());
  return position == 0 ? "none" : names[position - 1];
}

std::optional<std::size_t> find_quantity(const ResultSchema& schema, std::string_view name) {
  const auto found = std::ranges::find(schema.quantities, name, &Quantity::name);
  if (found == schema.quantities.end()) return std::nullopt;
  return static_cast<std::size_t>(found - schema.quantities.begin());
}

std::size_t num_correlations(const ResultSchema& schema) {
  const auto n = static_cast<std::size_t>(
      std::ranges::count_if(schema.quantities, &Quantity::has_standard_error));
  return n == 0 ? 0 : n * (n - 1) / 2;
}

const Quantity& example_quantity(const ResultSchema& schema) {
  return schema.quantities.at((schema.quantities.size() - 1) / 2);
}

std::vector<std::string_view> quantity_names(const ResultSchema& schema) {
  std::vector<std::string_view> names;
  for (const Quantity& quantity : schema.quantities) names.push_back(quantity.name);
  return names;
}

std::string_view name_of(RunStatus status) {
  switch (status) {
    case RunStatus::completed:
      return "completed";
    case RunStatus::not_converged:
      return "not_converged";
    case RunStatus::not_finite:
      return "not_finite";
    case RunStatus::no_draw:
      return "no_draw";
    case RunStatus::lost:
      return "lost";
  }
  PROOFMASS_EXPECT(false);
  return {};
}

std::vector<std::string> broken_count_rules(const RunResult& result, std::uint32_t num_draws_max,
                                            std::int64_t num_rounds_max) {
  std::vector<std::string> broken;
  const auto require_between = [&](std::string_view name, std::int64_t value, std::int64_t least,
                                   std::int64_t most) {
    if (value >= least && value <= most) return;
    broken.push_back(fmt::format("{} = {} (must be {} to {} if {})", name, value, least, most,
                                 name_of(result.status)));
  };
  const bool has_draw = result.has_truth();
  const bool used_all_rounds = result.status == RunStatus::not_converged;
  require_between("num_draws", result.num_draws, has_draw ? 1 : num_draws_max, num_draws_max);
  require_between("num_rounds", result.num_rounds, used_all_rounds ? num_rounds_max : 0,
                  has_draw ? num_rounds_max : 0);
  return broken;
}

void require_in_range(const RunResult& result, const ResultSchema& schema) {
  const auto require = [&](std::string_view kind, const Quantity& quantity, double value) {
    if (is_in_range(value)) return;
    throw Error(fmt::format("{}_{} of run {} = {} (must be in [{}, {}])", kind, quantity.column(),
                            result.run.value, value, -magnitude_max, magnitude_max));
  };
  for (std::size_t i = 0; i < schema.quantities.size(); ++i) {
    if (result.has_truth()) require("truth", schema.quantities[i], result.truth[i]);
    if (result.has_estimate()) require("estimate", schema.quantities[i], result.estimate[i]);
  }
}

}  // namespace proofmass
