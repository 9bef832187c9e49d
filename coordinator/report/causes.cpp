#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "coordinator/report/sensitivity.hpp"
#include "core/statistics/correlation.hpp"
#include "core/statistics/interval.hpp"
#include "core/statistics/sensitivity.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_correlated_of_each = 3;

using Correlations = std::vector<std::optional<double>>;  // With the error of each quantity.

Correlations correlations_of(std::span<const double> input, const DrawnRuns& drawn) {
  Correlations correlations;
  const double least = 4.0 / std::sqrt(static_cast<double>(input.size()));
  for (const std::vector<double>& errors : drawn.errors) {
    correlations.push_back(linear_correlation(input, errors));
    if (correlations.back() && std::abs(*correlations.back()) < least) correlations.back().reset();
  }
  return correlations;
}

void add_input(Causes& causes, const std::string& name, Correlations correlations) {
  if (std::ranges::find(causes.inputs, name) != causes.inputs.end()) return;
  causes.inputs.push_back(name);
  causes.correlations.push_back(std::move(correlations));
}

void add_terms(const DrawnRuns& drawn, std::size_t quantity, Causes& causes) {
  for (const ExplanatoryTerm& term : terms_of(drawn, quantity)) {
    const std::string name = term_name(drawn, term);
    causes.terms.push_back({quantity, name, term});
    add_input(causes, name, correlations_of(values_of_term(drawn, term), drawn));
  }
}

/// The columns that correlate the most with the error of a quantity.
void add_correlated(const DrawnRuns& drawn, std::size_t quantity,
                    std::span<const Correlations> of_columns, Causes& causes) {
  std::vector<std::pair<double, std::size_t>> ranked;
  for (std::size_t i = 0; i < of_columns.size(); ++i) {
    if (const auto& coefficient = of_columns[i][quantity]) {
      ranked.emplace_back(-std::abs(*coefficient), i);
    }
  }
  std::ranges::sort(ranked);
  if (ranked.size() > num_correlated_of_each) ranked.resize(num_correlated_of_each);
  for (const auto& [strength, column] : ranked) {
    add_input(causes, drawn.names[column], of_columns[column]);
  }
}

}  // namespace

std::optional<Causes> find_causes(const Store& store, const Campaign& campaign) {
  DrawnRuns drawn = read_drawn_runs(store, campaign, cause_runs_max);
  if (drawn.runs.size() < sensitivity_values_min) return std::nullopt;
  const std::vector<Quantity>& quantities = drawn.quantities;
  for (const Quantity& quantity : quantities) {  // A truth that is drawn itself has no column.
    const std::string of_truth = "truth_" + quantity.column();
    std::ranges::replace(drawn.names, of_truth, fmt::format("true {}", quantity.symbol));
  }
  Causes causes{.num_runs = drawn.runs.size(), .num_with_estimate = drawn.num_with_estimate};
  std::vector<Correlations> of_columns;
  for (const auto& column : drawn.columns) of_columns.push_back(correlations_of(column, drawn));
  for (std::size_t i = 0; i < drawn.errors.size(); ++i) add_terms(drawn, i, causes);
  for (std::size_t i = 0; i < drawn.errors.size(); ++i) {
    add_correlated(drawn, i, of_columns, causes);
  }
  return causes;
}

}  // namespace proofmass::coordinator
