#include "core/campaign/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/campaign/device.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"

namespace proofmass {
std::unique_ptr<DeviceSimulation> Plan::simulation_on(Device& /*device*/) const {
  PROOFMASS_EXPECT(runs_on_devices());
  return nullptr;
}

std::string_view name_of(Interpretation interpretation) {
  if (interpretation == Interpretation::ensemble) return "ensemble";
  return interpretation == Interpretation::temporal ? "temporal" : "mixed";
}

void check_identity(const Campaign& campaign) {
  check_campaign_name(campaign.name, NameOrigin::stored);
  if (campaign.seed > seed_max) {
    throw ConfigError("campaign.seed", fmt::format("{}", campaign.seed),
                      fmt::format("must be in [0, {}]", seed_max));
  }
  if (campaign.num_runs < 1 || campaign.num_runs > num_runs_max) {
    throw ConfigError("campaign.runs", fmt::format("{}", campaign.num_runs),
                      fmt::format("must be in [1, {}]", num_runs_max));
  }
  if (const std::uint64_t shared = campaign.realisations; shared < 1 || shared > realisations_max) {
    throw ConfigError("campaign.realisations", fmt::format("{}", shared),
                      fmt::format("must be in [1, {}]", realisations_max));
  }
}

std::vector<double> Campaign::table_values(RunIndex run) const {
  std::vector<double> values;
  values.reserve(table_columns.size());
  for (const std::vector<double>& column : table_columns) {
    PROOFMASS_EXPECT(run.value < column.size());
    values.push_back(column[run.value]);
  }
  return values;
}

namespace {

/// @param value_of  Of a term, at the assumed level.
template <typename ValueOf>
Budget budget_of(const ErrorBudget& budget, double level, const ValueOf& value_of) {
  const double ratio = level > 0.0 ? level / budget.assumed_level : 1.0;
  Budget sums;
  for (const BudgetTerm& term : budget.terms) {
    sums.entries.push_back(term.follows_level ? value_of(term) * ratio : value_of(term));
    sums.total += sums.entries.back();
  }
  return sums;
}

}  // namespace

Budget ErrorBudget::before(double level_of_runs) const {
  return budget_of(*this, level_of_runs, [](const BudgetTerm& term) { return term.before; });
}

Budget ErrorBudget::after(std::span<const double> errors, double level_of_runs) const {
  return budget_of(*this, level_of_runs, [errors](const BudgetTerm& term) {
    PROOFMASS_EXPECT(errors.size() == term.coefficients.size());
    return std::inner_product(errors.begin(), errors.end(), term.coefficients.begin(), 0.0);
  });
}

Budget ErrorBudget::of_run(const RunResult& result) const {
  std::vector<double> errors(result.estimate.size());
  for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = std::abs(result.error(i));
  return after(errors, level_of_run(result));
}

}  // namespace proofmass
