#include "coordinator/archive/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/run_ranges.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/value_passes.hpp"

namespace proofmass::coordinator {
namespace {

/// Differences of several parameters are kept together up to this size.
constexpr std::size_t kept_size = std::size_t{128} << 20;

/// Calls visit(first, second) for each run of either campaign, ascending; null for one that lacks
/// it.
template <typename Visit>
void walk_both(const ComparedCampaign& first, const ComparedCampaign& second, const Visit& visit) {
  const ResultStream next_of_first = first.open_results();
  const ResultStream next_of_second = second.open_results();
  std::optional<RunResult> a = next_of_first();
  std::optional<RunResult> b = next_of_second();
  while (a || b) {
    const bool has_first = a && !(b && b->run < a->run);
    const bool has_second = b && !(a && a->run < b->run);
    visit(has_first ? &*a : nullptr, has_second ? &*b : nullptr);
    if (has_first) a = next_of_first();
    if (has_second) b = next_of_second();
  }
}

bool have_same_draw(const RunResult& first, const RunResult& second) {
  return first.has_truth() == second.has_truth() &&
         (!first.has_truth() || std::ranges::equal(first.truth, second.truth, have_same_bits));
}

/// Finds out whether runs can be paired, and counts those without an estimate.
void survey(const ComparedCampaign& first, const ComparedCampaign& second,
            CampaignComparison& comparison) {
  comparison.missing_in_first = {.num_given_up = first.num_given_up};
  comparison.missing_in_second = {.num_given_up = second.num_given_up};
  std::string& why = comparison.why_unpaired;
  if (first.campaign.seed != second.campaign.seed) why = "the seeds differ";
  bool has_common_run = false;
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr) comparison.missing_in_first.add(*a);
    if (b != nullptr) comparison.missing_in_second.add(*b);
    if (a == nullptr || b == nullptr) return;
    has_common_run = true;
    if (why.empty() && !have_same_draw(*a, *b)) {
      why = fmt::format("the draws of run {} differ", a->run.value);
    }
  });
  if (why.empty() && !has_common_run) why = "no run is finished in both";
}

/// Calls visit(first, second) for the runs that are compared: pairs, or, if runs are not paired,
/// one of either campaign at a time.
template <typename Visit>
void walk_compared(const ComparedCampaign& first, const ComparedCampaign& second, bool is_paired,
                   const Visit& visit) {
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    const RunResult* const of_first = a != nullptr && a->has_estimate() ? a : nullptr;
    const RunResult* const of_second = b != nullptr && b->has_estimate() ? b : nullptr;
    if (is_paired && (of_first == nullptr || of_second == nullptr)) return;
    visit(of_first, of_second);
  });
}

double magnitude(const RunResult& result, std::size_t parameter) {
  return std::abs(result.error(parameter_infos()[parameter].parameter));
}

/// |error| of each parameter of one side; the order of parameter_infos().
using Magnitudes = std::vector<ValuePasses>;

Magnitudes make_magnitudes() { return Magnitudes(num_parameters, ValuePasses({})); }

void add_to(Magnitudes& magnitudes, const RunResult* result) {
  if (result == nullptr) return;
  for (std::size_t i = 0; i < num_parameters; ++i) magnitudes[i].add(magnitude(*result, i));
}

bool end_pass(Magnitudes& magnitudes) {
  bool is_another_needed = false;
  for (ValuePasses& parameter : magnitudes) {
    if (parameter.end_pass()) is_another_needed = true;
  }
  return is_another_needed;
}

struct BothMagnitudes {
  Magnitudes first = make_magnitudes();
  Magnitudes second = make_magnitudes();
};

BothMagnitudes read_magnitudes(const ComparedCampaign& first, const ComparedCampaign& second,
                               bool is_paired) {
  BothMagnitudes both;
  bool is_another_needed = true;
  while (is_another_needed) {
    walk_compared(first, second, is_paired, [&](const RunResult* a, const RunResult* b) {
      add_to(both.first, a);
      add_to(both.second, b);
    });
    const bool first_needs = end_pass(both.first);
    const bool second_needs = end_pass(both.second);
    is_another_needed = first_needs || second_needs;
  }
  return both;
}

ComparedAccuracy accuracy_of(const ValuePasses& magnitudes) {
  return {.worst = magnitudes.largest(),
          .mean = magnitudes.moments().mean,
          .standard_deviation = magnitudes.moments().standard_deviation};
}

void compare_pairs(const ComparedCampaign& first, const ComparedCampaign& second,
                   CampaignComparison& comparison) {
  const std::size_t size = comparison.num_first * sizeof(double);
  const std::size_t num_at_a_time = std::clamp(kept_size / size, std::size_t{1}, num_parameters);
  for (std::size_t begin = 0; begin < num_parameters; begin += num_at_a_time) {
    const std::size_t end = std::min(begin + num_at_a_time, num_parameters);
    std::vector<std::vector<double>> differences(end - begin);
    for (std::vector<double>& column : differences) column.reserve(comparison.num_first);
    walk_compared(first, second, true, [&](const RunResult* a, const RunResult* b) {
      for (std::size_t i = begin; i < end; ++i) {
        differences[i - begin].push_back(magnitude(*b, i) - magnitude(*a, i));
      }
    });
    for (std::size_t i = begin; i < end; ++i) {
      const PairedComparison paired =
          compare_differences(std::move(differences[i - begin]), default_confidence);
      ParameterComparison& parameter = comparison.parameters[i];
      parameter.mean_change = paired.mean_difference;
      parameter.interval = paired.interval;
      parameter.p_value = paired.rank_p_value;
    }
  }
}

void keep(const UnpairedComparison& unpaired, ParameterComparison& parameter) {
  parameter.mean_change = unpaired.mean_difference;
  parameter.interval = unpaired.interval;
  parameter.p_value = unpaired.p_value;
}

// Of few runs of one side, all of both are needed, one parameter after the other.
void compare_few(const ComparedCampaign& first, const ComparedCampaign& second, std::size_t i,
                 ParameterComparison& parameter) {
  std::vector<double> of_first, of_second;
  walk_compared(first, second, false, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr) of_first.push_back(magnitude(*a, i));
    if (b != nullptr) of_second.push_back(magnitude(*b, i));
  });
  keep(compare_unpaired(of_first, of_second, default_confidence), parameter);
}

void compare_parameters(const ComparedCampaign& first, const ComparedCampaign& second,
                        const BothMagnitudes& magnitudes, CampaignComparison& comparison) {
  for (std::size_t i = 0; i < num_parameters; ++i) {
    ParameterComparison& parameter = comparison.parameters[i];
    parameter.first = accuracy_of(magnitudes.first[i]);
    parameter.second = accuracy_of(magnitudes.second[i]);
    if (comparison.is_paired()) continue;
    if (std::min(comparison.num_first, comparison.num_second) < num_welch_min) {
      compare_few(first, second, i, parameter);
    } else {
      keep(compare_means(magnitudes.first[i].moments(), magnitudes.second[i].moments(),
                         default_confidence),
           parameter);
    }
  }
  if (comparison.is_paired()) compare_pairs(first, second, comparison);
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
                            .num_given_up = num_runs_in(store.given_up_runs()),
                            .open_results = {}};
  (void)walk_results(store, is_stopped, [](const RunResult& result) { require_in_range(result); });
  compared.open_results = [&store, is_stopped]() -> ResultStream {
    // A stream is copied, and its reader cannot be: all copies go on with the same one.
    const auto reader = std::make_shared<ResultReader>(store.results());
    return [reader, is_stopped]() -> std::optional<RunResult> {
      if (is_stopped()) throw Interrupted();
      return reader->next();
    };
  };
  return compared;
}

CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                     const ComparedCampaign& second) {
  CampaignComparison comparison;
  comparison.differences = all_differences(first, second);
  survey(first, second, comparison);
  const BothMagnitudes magnitudes = read_magnitudes(first, second, comparison.is_paired());
  comparison.num_first = magnitudes.first.front().count();
  comparison.num_second = magnitudes.second.front().count();
  comparison.why_not_compared = why_too_few(comparison);
  if (!comparison.why_not_compared.empty()) return comparison;
  compare_parameters(first, second, magnitudes, comparison);
  adjust_p_values(comparison.parameters);
  return comparison;
}

}  // namespace proofmass::coordinator
