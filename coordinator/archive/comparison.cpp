#include "coordinator/archive/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/run_ranges.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/moments.hpp"

namespace proofmass::coordinator {
namespace {

/// Runs of two campaigns that have the same index.
struct Pair {
  const RunResult& first;
  const RunResult& second;
};

std::vector<Pair> common_runs(std::span<const RunResult> first, std::span<const RunResult> second) {
  std::vector<Pair> pairs;
  auto other = second.begin();
  for (const RunResult& result : first) {
    while (other != second.end() && other->run < result.run) ++other;
    if (other == second.end()) break;
    if (other->run == result.run) pairs.push_back({result, *other});
  }
  return pairs;
}

std::string why_unpaired(const ComparedCampaign& first, const ComparedCampaign& second,
                         std::span<const Pair> pairs) {
  if (first.campaign.seed != second.campaign.seed) return "the seeds differ";
  if (pairs.empty()) return "no run is finished in both";
  for (const Pair& pair : pairs) {
    const bool is_same = pair.first.has_truth() == pair.second.has_truth() &&
                         (!pair.first.has_truth() ||
                          std::ranges::equal(pair.first.truth, pair.second.truth, have_same_bits));
    if (!is_same) return fmt::format("the draws of run {} differ", pair.first.run.value);
  }
  return "";
}

/// |error| of one parameter in each campaign; of pairs in the same order.
struct Magnitudes {
  std::vector<double> first;
  std::vector<double> second;
};

Magnitudes paired_magnitudes(std::span<const Pair> pairs, Parameter parameter) {
  Magnitudes magnitudes;
  for (const Pair& pair : pairs) {
    if (!pair.first.has_estimate() || !pair.second.has_estimate()) continue;
    magnitudes.first.push_back(std::abs(pair.first.error(parameter)));
    magnitudes.second.push_back(std::abs(pair.second.error(parameter)));
  }
  return magnitudes;
}

std::vector<double> magnitudes_of(std::span<const RunResult> results, Parameter parameter) {
  std::vector<double> magnitudes;
  for (const RunResult& result : results) {
    if (result.has_estimate()) magnitudes.push_back(std::abs(result.error(parameter)));
  }
  return magnitudes;
}

MissingEstimates missing_in(const ComparedCampaign& side) {
  MissingEstimates missing{.num_given_up = side.num_given_up};
  for (const RunResult& result : side.results) missing.add(result);
  return missing;
}

ComparedAccuracy accuracy_of(std::span<const double> magnitudes) {
  const Moments all = moments(magnitudes);
  return {.worst = *std::ranges::max_element(magnitudes),
          .mean = all.mean,
          .standard_deviation = all.standard_deviation};
}

ParameterComparison compared(const Magnitudes& magnitudes, bool is_paired) {
  const auto& [first, second] = magnitudes;
  ParameterComparison comparison;
  comparison.first = accuracy_of(first);
  comparison.second = accuracy_of(second);
  if (is_paired) {
    const PairedComparison paired = compare_paired(first, second, default_confidence);
    comparison.mean_change = paired.mean_difference;
    comparison.interval = paired.interval;
    comparison.p_value = paired.rank_p_value;
  } else {
    const UnpairedComparison unpaired = compare_unpaired(first, second, default_confidence);
    comparison.mean_change = unpaired.mean_difference;
    comparison.interval = unpaired.interval;
    comparison.p_value = unpaired.p_value;
  }
  return comparison;
}

void adjust_p_values(std::array<ParameterComparison, num_parameters>& parameters) {
  std::vector<double> p_values;
  for (const ParameterComparison& parameter : parameters) p_values.push_back(parameter.p_value);
  const std::vector<double> adjusted = holm_adjusted(p_values);
  for (std::size_t i = 0; i < num_parameters; ++i) parameters[i].adjusted_p_value = adjusted[i];
}

std::vector<DefinitionDifference> all_differences(const ComparedCampaign& first,
                                                  const ComparedCampaign& second) {
  std::vector<DefinitionDifference> differences =
      compare_definitions(first.campaign, second.campaign);
  if (first.model_version != second.model_version) {
    differences.push_back({"model", first.model_version, second.model_version});
  }
  if (first.build != second.build) differences.push_back({"build", first.build, second.build});
  return differences;
}

std::string why_too_few(const CampaignComparison& comparison) {
  const std::size_t num_needed = comparison.is_paired() ? 1 : 2;
  if (std::min(comparison.num_first, comparison.num_second) >= num_needed) return "";
  return fmt::format("{} and {} runs with an estimate (must be at least {})", comparison.num_first,
                     comparison.num_second, num_needed);
}

}  // namespace

ComparedCampaign read_compared(const Store& store, const IsStopped& is_stopped) {
  ComparedCampaign compared{.campaign = stored_campaign(store),
                            .model_version = store.model_version(),
                            .build = store.build(),
                            .results = {},
                            .num_given_up = num_runs_in(store.given_up_runs())};
  walk_results(store, is_stopped, [&](const RunResult& result) {
    require_in_range(result);
    compared.results.push_back(result);
  });
  return compared;
}

CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                     const ComparedCampaign& second) {
  CampaignComparison comparison;
  comparison.differences = all_differences(first, second);
  comparison.missing_in_first = missing_in(first);
  comparison.missing_in_second = missing_in(second);
  const std::vector<Pair> pairs = common_runs(first.results, second.results);
  comparison.why_unpaired = why_unpaired(first, second, pairs);
  for (const ParameterInfo& info : parameter_infos()) {
    const Magnitudes magnitudes = comparison.is_paired()
                                      ? paired_magnitudes(pairs, info.parameter)
                                      : Magnitudes{magnitudes_of(first.results, info.parameter),
                                                   magnitudes_of(second.results, info.parameter)};
    comparison.num_first = magnitudes.first.size();
    comparison.num_second = magnitudes.second.size();
    comparison.why_not_compared = why_too_few(comparison);
    if (!comparison.why_not_compared.empty()) return comparison;
    comparison.parameters[index(info.parameter)] = compared(magnitudes, comparison.is_paired());
  }
  adjust_p_values(comparison.parameters);
  return comparison;
}

}  // namespace proofmass::coordinator
