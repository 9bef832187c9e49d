#include "core/campaign/run_result.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "core/error.hpp"

namespace proofmass {

std::string_view name_at(const std::vector<std::string_view>& names, std::uint32_t position) {
  PROOFMASS_EXPECT(position <= names.size());
  return position == 0 ? "none" : names[position - 1];
}

std::string loss_text(const ResultSchema& schema, const Loss& loss) {
  const std::string_view cause = name_at(schema.loss_causes, loss.cause);
  // The only cause of model programs and imports: they tell that a run is lost, and not why.
  if (cause == "program") return "said by the model";
  return fmt::format("{} in {}", cause, name_at(schema.loss_sessions, loss.session));
}

std::optional<std::size_t> find_quantity(const ResultSchema& schema, std::string_view name) {
  const auto found = std::ranges::find(schema.quantities, name, &Quantity::name);
  if (found == schema.quantities.end()) return std::nullopt;
  return static_cast<std::size_t>(found - schema.quantities.begin());
}

std::size_t num_standard_errors(const ResultSchema& schema) {
  return static_cast<std::size_t>(
      std::ranges::count_if(schema.quantities, &Quantity::has_standard_error));
}

std::size_t num_correlations(const ResultSchema& schema) {
  const std::size_t n = num_standard_errors(schema);
  return n == 0 ? 0 : n * (n - 1) / 2;
}

Quantity example_quantity(const ResultSchema& schema) {
  return schema.quantities.at((schema.quantities.size() - 1) / 2);
}

std::vector<std::string_view> quantity_names(const ResultSchema& schema) {
  std::vector<std::string_view> names;
  for (const Quantity& quantity : schema.quantities) names.push_back(quantity.name);
  return names;
}

std::string_view name_of(RunStatus status) {
  static constexpr std::array<std::string_view, 5> names{"completed", "not_converged", "not_finite",
                                                         "no_draw", "lost"};
  return names.at(static_cast<std::size_t>(status) - 1);
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

std::vector<std::string> broken_size_rules(const RunResult& result, const ResultSchema& schema) {
  std::vector<std::string> broken;
  const auto require = [&](std::string_view name, std::size_t size, std::size_t must) {
    if (size == must) return;
    broken.push_back(fmt::format("{} = {} entries (must be {} if {})", name, size, must,
                                 name_of(result.status)));
  };
  const std::size_t num_truths = result.has_truth() ? schema.quantities.size() : 0;
  const bool has_errors = result.has_estimate() && !result.standard_error.empty();
  const auto if_errors = [&](std::size_t size) { return has_errors ? size : 0; };
  require("truth", result.truth.size(), num_truths);
  require("estimate", result.estimate.size(), result.has_estimate() ? num_truths : 0);
  require("standard_error", result.standard_error.size(), if_errors(num_standard_errors(schema)));
  require("fit", result.fit.size(), if_errors(schema.fit.size()));
  require("correlation", result.correlations.size(), if_errors(num_correlations(schema)));
  if (!result.health.empty()) {
    require("health", result.health.size(), result.has_truth() ? schema.health.size() : 0);
  }
  const auto require_name = [&](std::string_view name, std::uint32_t position,
                                const std::vector<std::string_view>& names) {
    const std::size_t least = result.status == RunStatus::lost ? 1 : 0;
    const std::size_t most = least * names.size();
    if (position >= least && position <= most) return;
    broken.push_back(fmt::format("{} = {} (must be in [{}, {}] if {})", name, position, least, most,
                                 name_of(result.status)));
  };
  require_name("loss_cause", result.loss.cause, schema.loss_causes);
  require_name("loss_session", result.loss.session, schema.loss_sessions);
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
