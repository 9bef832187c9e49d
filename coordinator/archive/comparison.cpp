#include "coordinator/archive/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
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

/// Errors of several parameters are kept together up to this size.
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

std::size_t num_quantities() { return model().results().quantities.size(); }

/// Errors of some parameters, from `begin` on, in the runs of one side that have an estimate.
class SideErrors {
 public:
  SideErrors(std::size_t begin, std::size_t end) : begin_(begin), columns_(end - begin) {}

  /// @param has_pair  Whether the other side has an estimate of the run as well.
  void add(const RunResult& result, bool has_pair) {
    for (std::size_t i = 0; i < columns_.size(); ++i)
      columns_[i].push_back(result.error(begin_ + i));
    have_pairs_.push_back(has_pair);
  }
  void keep_pairs() {
    for (std::vector<double>& errors : columns_) {
      std::size_t num_kept = 0;
      for (std::size_t i = 0; i < errors.size(); ++i) {
        if (have_pairs_[i]) errors[num_kept++] = errors[i];
      }
      errors.resize(num_kept);
    }
  }
  [[nodiscard]] const std::vector<double>& of(std::size_t parameter) const {
    return columns_[parameter - begin_];
  }

 private:
  std::size_t begin_;
  std::vector<std::vector<double>> columns_;
  std::vector<bool> have_pairs_;
};

/// Reads the errors that are compared, and sets why they are not those of pairs.
void read_errors(const ComparedCampaign& first, const ComparedCampaign& second,
                 CampaignComparison& comparison, SideErrors& of_first, SideErrors& of_second) {
  std::string why = first.campaign->seed == second.campaign->seed ? "" : "the seeds differ";
  bool has_common_run = false;
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr && b != nullptr) {
      has_common_run = true;
      if (why.empty() && !have_same_draw(*a, *b)) {
        why = fmt::format("the draws of run {} differ", a->run.value);
      }
    }
    const bool has_first = a != nullptr && a->is_completed();
    const bool has_second = b != nullptr && b->is_completed();
    if (has_first) of_first.add(*a, has_second);
    if (has_second) of_second.add(*b, has_first);
  });
  if (why.empty() && !has_common_run) why = "no run is finished in both";
  comparison.why_unpaired = why;
  if (!comparison.is_paired()) return;
  of_first.keep_pairs();
  of_second.keep_pairs();
}

ComparedAccuracy accuracy_of(std::span<const double> errors, double limit) {
  const Moments about = moments(errors);
  ComparedAccuracy accuracy{.bias = about.mean,
                            .standard_deviation = about.standard_deviation,
                            .num_in_tail = num_beyond(errors, limit)};
  CompensatedSum magnitudes;
  for (const double error : errors) {
    magnitudes.add(std::abs(error));
    accuracy.worst = std::max(accuracy.worst, std::abs(error));
  }
  accuracy.mean = magnitudes.value() / static_cast<double>(errors.size());
  return accuracy;
}

ParameterComparison compared_parameter(const std::vector<double>& first,
                                       const std::vector<double>& second, bool is_paired) {
  const double limit = tail_limit(first, second);
  ParameterComparison parameter;
  parameter.first = accuracy_of(first, limit);
  parameter.second = accuracy_of(second, limit);
  parameter.tail_limit = limit;
  if (is_paired) {
    std::vector<double> differences(first.size());
    std::ranges::transform(second, first, differences.begin(), std::minus<>());
    parameter.bias_interval = mean_interval(moments(differences), default_confidence);
    parameter.smallest_scale_factor = smallest_paired_scale_factor(first, second, num_quantities());
    parameter.p_values = compare_paired_errors(first, second);
  } else {
    parameter.bias_interval =
        compare_means(moments(first), moments(second), default_confidence).interval;
    parameter.smallest_scale_factor = smallest_scale_factor(first, second, num_quantities());
    parameter.p_values = compare_errors(first, second);
  }
  return parameter;
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

std::string why_not_compared(const ComparedCampaign& first, const ComparedCampaign& second,
                             const CampaignComparison& comparison) {
  const std::size_t num_needed = comparison.is_paired() ? 1 : 2;
  if (std::min(comparison.num_first, comparison.num_second) < num_needed) {
    return fmt::format("{} and {} runs with an estimate (must be at least {})",
                       comparison.num_first, comparison.num_second, num_needed);
  }
  const std::string why = why_not_independent(*first.campaign);
  return why.empty() ? why_not_independent(*second.campaign) : why;
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
  const MissingEstimates missing =
      missing_in(checked.results.statistics, num_runs_in(checked.given_up));
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
  const std::uint64_t size =
      (first.campaign->num_runs + second.campaign->num_runs) * sizeof(double);
  const std::size_t num_at_a_time = std::clamp(kept_size / size, std::size_t{1}, num_quantities());
  for (std::size_t begin = 0; begin < num_quantities(); begin += num_at_a_time) {
    const std::size_t end = std::min(begin + num_at_a_time, num_quantities());
    SideErrors of_first(begin, end), of_second(begin, end);
    read_errors(first, second, comparison, of_first, of_second);
    comparison.num_first = of_first.of(begin).size();
    comparison.num_second = of_second.of(begin).size();
    comparison.why_not_compared = why_not_compared(first, second, comparison);
    if (!comparison.why_not_compared.empty()) return comparison;
    for (std::size_t i = begin; i < end; ++i) {
      comparison.parameters[i] =
          compared_parameter(of_first.of(i), of_second.of(i), comparison.is_paired());
    }
  }
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
