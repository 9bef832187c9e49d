#include "coordinator/archive/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/store/result_columns.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/independence.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "core/statistics/comparison.hpp"
#include "core/statistics/error_change.hpp"
#include "core/statistics/moments.hpp"

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

/// Calls visit(first, second) for runs that are compared: a pair, or, if runs are not paired, one
/// of either campaign.
template <typename Visit>
void visit_compared(const RunResult* a, const RunResult* b, bool is_paired, const Visit& visit) {
  const RunResult* const of_first = a != nullptr && a->is_completed() ? a : nullptr;
  const RunResult* const of_second = b != nullptr && b->is_completed() ? b : nullptr;
  if (is_paired && (of_first == nullptr || of_second == nullptr)) return;
  visit(of_first, of_second);
}

/// visit_compared() for all runs of both campaigns, in run order.
template <typename Visit>
void walk_compared(const ComparedCampaign& first, const ComparedCampaign& second, bool is_paired,
                   const Visit& visit) {
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    visit_compared(a, b, is_paired, visit);
  });
}

std::size_t num_quantities() { return model().results().quantities.size(); }

/// Errors of one side in two passes, and the largest |error| of each parameter; the order of
/// the model's quantities.
struct SideErrors {
  std::vector<ErrorPasses> errors = std::vector<ErrorPasses>(num_quantities());
  std::vector<double> worst = std::vector<double>(num_quantities());
  std::vector<CompensatedSum> magnitudes = std::vector<CompensatedSum>(num_quantities());

  void add(const RunResult* result) {
    if (result == nullptr) return;
    for (std::size_t i = 0; i < num_quantities(); ++i) {
      const double error = result->error(i);
      errors[i].add(error);
      magnitudes[i].add(std::abs(error));
      worst[i] = std::max(worst[i], std::abs(error));
    }
  }

  void add_again(const RunResult* result) {
    if (result == nullptr) return;
    for (std::size_t i = 0; i < num_quantities(); ++i) errors[i].add_again(result->error(i));
  }

  [[nodiscard]] ComparedAccuracy accuracy(std::size_t parameter) const {
    const ErrorPasses& passes = errors[parameter];
    const Moments about = passes.errors();
    return {.bias = about.mean,
            .standard_deviation = about.standard_deviation,
            .mean = magnitudes[parameter].value() / static_cast<double>(passes.count()),
            .worst = worst[parameter],
            .num_in_tail = passes.num_in_tail()};
  }
};

struct BothErrors {
  SideErrors first;
  SideErrors second;
  std::vector<double> tail_limits = std::vector<double>(num_quantities());

  void add(const RunResult* a, const RunResult* b) {
    first.add(a);
    second.add(b);
  }
  void begin_second() {
    for (std::size_t i = 0; i < num_quantities(); ++i) {
      tail_limits[i] = tail_limit(first.errors[i], second.errors[i]);
      first.errors[i].begin_second(tail_limits[i]);
      second.errors[i].begin_second(tail_limits[i]);
    }
  }
  void add_again(const RunResult* a, const RunResult* b) {
    first.add_again(a);
    second.add_again(b);
  }
};

/// Each pass reads both files, which takes most of the time, so that the first one has all that can
/// be known at once: it takes runs for paired until they prove not to be.
void read_first_pass(const ComparedCampaign& first, const ComparedCampaign& second,
                     CampaignComparison& comparison, BothErrors& errors) {
  std::string& why = comparison.why_unpaired;
  if (first.campaign->seed != second.campaign->seed) why = "the seeds differ";
  const bool was_paired = comparison.is_paired();
  bool has_common_run = false;
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr && b != nullptr) {
      has_common_run = true;
      if (why.empty() && !have_same_draw(*a, *b)) {
        why = fmt::format("the draws of run {} differ", a->run.value);
      }
    }
    if (comparison.is_paired() != was_paired) return;
    visit_compared(a, b, was_paired, [&](const RunResult* of_first, const RunResult* of_second) {
      errors.add(of_first, of_second);
    });
  });
  if (why.empty() && !has_common_run) why = "no run is finished in both";
  if (comparison.is_paired() == was_paired) return;
  errors = {};
  walk_compared(first, second, false,
                [&](const RunResult* a, const RunResult* b) { errors.add(a, b); });
}

/// What is compared of some parameters of all pairs; 16 bytes a pair and parameter.
class Pairs {
 public:
  Pairs(std::size_t begin, std::size_t end, std::size_t num_pairs)
      : begin_(begin), parameters_(end - begin) {
    for (PairedErrors& parameter : parameters_) {
      parameter.differences.reserve(num_pairs);
      parameter.deviation_differences.reserve(num_pairs);
    }
  }

  void add(const RunResult& first, const RunResult& second, const BothErrors& errors) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      const std::size_t parameter = begin_ + i;
      parameters_[i].add(
          {.error = first.error(parameter), .mean = errors.first.errors[parameter].mean()},
          {.error = second.error(parameter), .mean = errors.second.errors[parameter].mean()},
          errors.tail_limits[parameter]);
    }
  }

  void compare(const BothErrors& errors, CampaignComparison& comparison) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      ParameterComparison& parameter = comparison.parameters[begin_ + i];
      parameter.bias_interval =
          mean_interval(moments(parameters_[i].differences), default_confidence);
      parameter.smallest_scale_factor =
          smallest_scale_factor(errors.first.errors[begin_ + i], parameters_[i], num_quantities());
      parameter.p_values = compare_paired_errors(std::move(parameters_[i]));
    }
  }

 private:
  std::size_t begin_;
  std::vector<PairedErrors> parameters_;
};

void compare_pairs(const ComparedCampaign& first, const ComparedCampaign& second,
                   BothErrors& errors, CampaignComparison& comparison) {
  const std::size_t size = comparison.num_first * 2 * sizeof(double);
  const std::size_t num_at_a_time = std::clamp(kept_size / size, std::size_t{1}, num_quantities());
  for (std::size_t begin = 0; begin < num_quantities(); begin += num_at_a_time) {
    Pairs pairs(begin, std::min(begin + num_at_a_time, num_quantities()), comparison.num_first);
    walk_compared(first, second, true, [&](const RunResult* a, const RunResult* b) {
      if (begin == 0) errors.add_again(a, b);
      pairs.add(*a, *b, errors);
    });
    pairs.compare(errors, comparison);
  }
}

// Of few runs of one side, all of both are needed, one parameter after the other.
ChangePValues compare_few(const ComparedCampaign& first, const ComparedCampaign& second,
                          std::size_t parameter) {
  std::vector<double> of_first, of_second;
  walk_compared(first, second, false, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr) of_first.push_back(a->error(parameter));
    if (b != nullptr) of_second.push_back(b->error(parameter));
  });
  return compare_few_errors(of_first, of_second);
}

void compare_unpaired_runs(const ComparedCampaign& first, const ComparedCampaign& second,
                           BothErrors& errors, CampaignComparison& comparison) {
  walk_compared(first, second, false,
                [&](const RunResult* a, const RunResult* b) { errors.add_again(a, b); });
  const bool are_few = std::min(comparison.num_first, comparison.num_second) < num_welch_min;
  for (std::size_t i = 0; i < num_quantities(); ++i) {
    ParameterComparison& parameter = comparison.parameters[i];
    const ErrorPasses& a = errors.first.errors[i];
    const ErrorPasses& b = errors.second.errors[i];
    parameter.bias_interval = compare_means(a.errors(), b.errors(), default_confidence).interval;
    parameter.p_values = are_few ? compare_few(first, second, i) : compare_many_errors(a, b);
    if (!are_few) parameter.smallest_scale_factor = smallest_scale_factor(a, b, num_quantities());
  }
}

void keep_accuracies(const BothErrors& errors, CampaignComparison& comparison) {
  for (std::size_t i = 0; i < num_quantities(); ++i) {
    ParameterComparison& parameter = comparison.parameters[i];
    parameter.first = errors.first.accuracy(i);
    parameter.second = errors.second.accuracy(i);
    parameter.tail_limit = errors.tail_limits[i];
  }
}

std::vector<DefinitionDifference> all_differences(const ComparedCampaign& first,
                                                  const ComparedCampaign& second) {
  std::vector<DefinitionDifference> differences =
      first.campaign->differences_from(*second.campaign);
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

/// A campaign of a file, of which one state is read.
struct OpenCampaign {
  ComparedMember member;
  ComparedCampaign compared;
};

/// @param store  Outlives what is returned.
OpenCampaign open_campaign(const Store& store, const std::filesystem::path& file,
                           const IsStopped& is_stopped) {
  if (is_stopped()) throw Interrupted();
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  CheckedResults checked = read_checked_results(store, *campaign);
  const CampaignStatistics& statistics = checked.results.statistics;
  const MissingEstimates missing{.num_not_converged = statistics.num_not_converged,
                                 .num_not_finite = statistics.num_not_finite,
                                 .num_no_draw = statistics.num_no_draw,
                                 .num_lost = statistics.num_lost,
                                 .num_given_up = num_runs_in(checked.given_up)};
  const auto open_results = [&store, is_stopped]() -> ResultStream {
    // A stream is copied, and its reader cannot be: all copies go on with the same one.
    return [reader = std::make_shared<ResultReader>(store.results()), is_stopped] {
      if (is_stopped()) throw Interrupted();
      return reader->next();
    };
  };
  return {.member = {.file = file,
                     .num_runs = store.num_runs(),
                     .statistics = std::move(checked.results.statistics),
                     .digest = checked.results.digests.results,
                     .missing = missing,
                     .objectives = campaign->objectives(),
                     .comparison = std::nullopt},
          .compared = {.campaign = campaign,
                       .model_version = store.model_version(),
                       .build = store.build(),
                       .open_results = open_results}};
}

}  // namespace

CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                     const ComparedCampaign& second) {
  CampaignComparison comparison;
  comparison.differences = all_differences(first, second);
  comparison.parameters.resize(num_quantities());
  BothErrors errors;
  read_first_pass(first, second, comparison, errors);
  comparison.num_first = errors.first.errors.front().count();
  comparison.num_second = errors.second.errors.front().count();
  comparison.why_not_compared = why_too_few(comparison);
  for (const ComparedCampaign* const side : {&first, &second}) {
    if (!comparison.why_not_compared.empty()) break;
    comparison.why_not_compared = why_not_independent(*side->campaign);
  }
  if (!comparison.why_not_compared.empty()) return comparison;
  errors.begin_second();
  const auto compare = comparison.is_paired() ? compare_pairs : compare_unpaired_runs;
  compare(first, second, errors, comparison);
  keep_accuracies(errors, comparison);
  return comparison;
}

std::vector<ComparedMember> compare_several(std::span<const std::filesystem::path> files,
                                            const IsStopped& is_stopped) {
  PROOFMASS_EXPECT(files.size() >= 2);
  std::vector<ComparedMember> members;
  const Store first_store = Store::open_read_only(files.front());
  first_store.read_one_state([&] {
    const OpenCampaign first = open_campaign(first_store, files.front(), is_stopped);
    members.push_back(first.member);
    for (const std::filesystem::path& file : files.subspan(1)) {
      const Store store = Store::open_read_only(file);
      store.read_one_state([&] {
        OpenCampaign other = open_campaign(store, file, is_stopped);
        other.member.comparison = compare_campaigns(first.compared, other.compared);
        members.push_back(std::move(other.member));
      });
    }
  });
  adjust_together(members);
  return members;
}

void adjust_together(std::span<ComparedMember> members) {
  std::vector<ParameterComparison*> compared;
  std::vector<ChangePValues> p_values;
  for (ComparedMember& member : members) {
    if (!member.comparison || !member.comparison->why_not_compared.empty()) continue;
    for (ParameterComparison& parameter : member.comparison->parameters) {
      compared.push_back(&parameter);
      p_values.push_back(parameter.p_values);
    }
  }
  const std::vector<ChangePValues> adjusted = adjusted_changes(p_values);
  for (std::size_t i = 0; i < compared.size(); ++i) compared[i]->adjusted_p_values = adjusted[i];
}

}  // namespace proofmass::coordinator
