#include "coordinator/archive/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/independence.hpp"
#include "core/campaign/result_columns.hpp"
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

/// A quantity that both campaigns have: its place among those of each.
struct CommonQuantity {
  std::size_t in_first = 0;
  std::size_t in_second = 0;
};

std::vector<CommonQuantity> common_quantities(std::span<const Quantity> first,
                                              std::span<const Quantity> second) {
  std::vector<CommonQuantity> common;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const std::size_t place = place_of(first[i], second);
    if (place < second.size()) common.push_back({.in_first = i, .in_second = place});
  }
  return common;
}

bool have_same_truth(std::span<const CommonQuantity> common, const RunResult& first,
                     const RunResult& second) {
  if (first.has_truth() != second.has_truth()) return false;
  return !first.has_truth() || std::ranges::all_of(common, [&](const CommonQuantity& quantity) {
    return have_same_bits(first.truth[quantity.in_first], second.truth[quantity.in_second]);
  });
}

/// Where a parameter of a model program stands in a truth, draws that are the same have other
/// truths: those that their definitions yield.
bool have_same_values(const ComparedCampaign& first, const ComparedCampaign& second,
                      const RunResult& of_first, const RunResult& of_second) {
  if (first.model_version != second.model_version) return false;
  const RunDraw a = first.campaign->draw(of_first.run), b = second.campaign->draw(of_second.run);
  return std::ranges::equal(a.truth, of_first.truth, have_same_bits) &&
         std::ranges::equal(b.truth, of_second.truth, have_same_bits) &&
         std::ranges::equal(a.values, b.values, have_same_bits);
}

/// What the other side has of a run with an estimate.
enum class Partner : std::uint8_t { none, without_estimate, with_estimate };

Partner partner_of(const RunResult* other) {
  if (other == nullptr) return Partner::none;
  return other->is_completed() ? Partner::with_estimate : Partner::without_estimate;
}

/// Errors of some parameters in the runs of one side that have an estimate.
class SideErrors {
 public:
  /// @param place  Of each among the quantities of the side.
  SideErrors(std::span<const CommonQuantity> parameters, std::size_t CommonQuantity::*place)
      : parameters_(parameters), place_(place), columns_(parameters.size()) {}

  void add(const RunResult& result, Partner partner) {
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      columns_[i].push_back(result.error(parameters_[i].*place_));
    }
    partners_.push_back(partner);
  }
  [[nodiscard]] std::size_t count(Partner partner) const {
    return static_cast<std::size_t>(std::ranges::count(partners_, partner));
  }
  [[nodiscard]] std::size_t size() const { return partners_.size(); }
  [[nodiscard]] const std::vector<double>& of(std::size_t i) const { return columns_[i]; }
  /// Those of the runs of which the other side has this.
  [[nodiscard]] std::vector<double> of(std::size_t i, Partner partner) const {
    std::vector<double> errors;
    for (std::size_t k = 0; k < size(); ++k) {
      if (partners_[k] == partner) errors.push_back(columns_[i][k]);
    }
    return errors;
  }

 private:
  std::span<const CommonQuantity> parameters_;
  std::size_t CommonQuantity::*place_;
  std::vector<std::vector<double>> columns_;
  std::vector<Partner> partners_;
};

/// Reads the errors that are compared, and sets how many there are and why they are not paired.
void read_errors(const ComparedCampaign& first, const ComparedCampaign& second,
                 std::span<const CommonQuantity> common, CampaignComparison& comparison,
                 SideErrors& of_first, SideErrors& of_second) {
  std::string why = first.campaign->seed == second.campaign->seed ? "" : "the seeds differ";
  bool has_common_run = false;
  std::optional<std::vector<double>> first_truth;
  bool varies = false;
  walk_both(first, second, [&](const RunResult* a, const RunResult* b) {
    if (a != nullptr && b != nullptr) {
      has_common_run = true;
      if (!first_truth) first_truth = a->truth;
      varies = varies || a->truth != first_truth;
      if (why.empty() && !have_same_truth(common, *a, *b) &&
          !have_same_values(first, second, *a, *b)) {
        why = fmt::format("the draws of run {} differ", a->run.value);
      }
    }
    if (a != nullptr && a->is_completed()) of_first.add(*a, partner_of(b));
    if (b != nullptr && b->is_completed()) of_second.add(*b, partner_of(a));
  });
  if (why.empty() && !has_common_run) why = "no run is finished in both";
  if (why.empty() && !varies && first.campaign->model().is_imported()) {
    why = "imported truths that are the same in all runs do not tell whose draws they are";
  }
  comparison.why_unpaired = why;
  comparison.first.num_estimated = of_first.size();
  comparison.second.num_estimated = of_second.size();
  if (!comparison.is_paired()) return;
  comparison.num_pairs = of_first.count(Partner::with_estimate);
  const std::size_t a = of_first.count(Partner::none), b = of_second.count(Partner::none);
  comparison.first.num_alone = a;
  comparison.second.num_alone = b;
  const bool are_many = std::max(a, b) >= std::max(comparison.num_pairs, std::size_t{2});
  if (!are_many || std::min(of_first.size(), of_second.size()) < 2) return;
  (a > b ? comparison.first : comparison.second).num_tested = std::max(a, b);
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

/// The p-values of two tests together, of which the smaller may be chosen.
ChangePValues smaller_of(const ChangePValues& a, const ChangePValues& b) {
  const auto smaller = [](double x, double y) { return std::min(2.0 * std::min(x, y), 1.0); };
  return {.location = smaller(a.location, b.location),
          .scale = smaller(a.scale, b.scale),
          .tail = smaller(a.tail, b.tail)};
}

void compare_parameter(const CampaignComparison& comparison, const SideErrors& of_first,
                       const SideErrors& of_second, std::size_t i, ParameterComparison& parameter) {
  const std::vector<double>& first = of_first.of(i);
  const std::vector<double>& second = of_second.of(i);
  const double limit = tail_limit(first, second);
  parameter.first = accuracy_of(first, limit);
  parameter.second = accuracy_of(second, limit);
  parameter.tail_limit = limit;
  const std::size_t num_quantities = comparison.parameters.size();
  if (!comparison.is_paired()) {
    const UnpairedComparison means =
        compare_means(moments(first), moments(second), default_confidence);
    parameter.bias_change = means.mean_difference;
    parameter.bias_interval = means.interval;
    parameter.smallest_scale_factor = smallest_scale_factor(first, second, num_quantities);
    parameter.p_values = compare_errors(first, second);
    return;
  }
  const std::vector<double> a = of_first.of(i, Partner::with_estimate);
  const std::vector<double> b = of_second.of(i, Partner::with_estimate);
  std::vector<double> differences(a.size());
  std::ranges::transform(b, a, differences.begin(), std::minus<>());
  parameter.bias_change = moments(differences).mean;
  parameter.bias_interval = mean_interval(moments(differences), default_confidence);
  parameter.p_values = compare_paired_errors(a, b);
  const bool tests_first = comparison.first.num_tested > 0;
  const bool tests_others = tests_first || comparison.second.num_tested > 0;
  parameter.smallest_scale_factor =
      smallest_paired_scale_factor(a, b, tests_others ? 2 * num_quantities : num_quantities);
  if (!tests_others) return;
  parameter.p_values = smaller_of(
      parameter.p_values, tests_first ? compare_errors(of_first.of(i, Partner::none), second)
                                      : compare_errors(first, of_second.of(i, Partner::none)));
}

std::vector<DefinitionDifference> all_differences(const ComparedCampaign& first,
                                                  const ComparedCampaign& second) {
  std::vector<DefinitionDifference> differences =
      first.campaign->differences_from(*second.campaign);
  if (first.model_version != second.model_version) {
    differences.push_back({"model", first.model_version, second.model_version});
  } else if (first.reference_digest != second.reference_digest) {
    differences.push_back({"reference_digest", fmt::format("{:016x}", first.reference_digest),
                           fmt::format("{:016x}", second.reference_digest)});
  }
  if (first.build != second.build) differences.push_back({"build", first.build, second.build});
  return differences;
}

std::string why_not_compared(const ComparedCampaign& first, const ComparedCampaign& second,
                             const CampaignComparison& comparison) {
  if (comparison.is_paired() && comparison.num_pairs < 2) {
    return comparison.num_pairs == 0 ? "no run has an estimate in both"
                                     : "one run has an estimate in both (must be at least 2)";
  }
  const std::size_t a = comparison.first.num_estimated, b = comparison.second.num_estimated;
  if (!comparison.is_paired() && std::min(a, b) < 2) {
    return fmt::format("{} and {} runs with an estimate (must be at least 2)", a, b);
  }
  const std::string why = why_not_independent(*first.campaign);
  return why.empty() ? why_not_independent(*second.campaign) : why;
}

/// @param store  Of which one state is read; outlives ComparedCampaign::open_results.
ComparedCampaign open_campaign(const Store& store, const std::filesystem::path& file,
                               const HeedStop& heed_stop) {
  heed_stop();
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  const JudgedRuns judged = judged_runs(store.finished_runs(), store.given_up_runs());
  const auto open_results = [&store, heed_stop, judged]() -> ResultStream {
    // A stream is copied, and its reader cannot be: all copies go on with the same one.
    return [reader = std::make_shared<ResultReader>(store.results()), heed_stop, end = judged.end] {
      heed_stop();
      std::optional<RunResult> result = reader->next();
      return result && result->run.value < end ? std::move(result) : std::nullopt;
    };
  };
  return {.file = file,
          .campaign = campaign,
          .quantities = store.schema().quantities,
          .model_version = store.model_version(),
          .reference_digest = store.reference_digest(),
          .build = store.build(),
          .num_left_out = judged.num_left_out,
          .results = read_checked_results(store, *campaign),
          .open_results = open_results};
}

}  // namespace

CampaignComparison compare_campaigns(const ComparedCampaign& first,
                                     const ComparedCampaign& second) {
  CampaignComparison comparison;
  comparison.differences = all_differences(first, second);
  const std::vector<CommonQuantity> common = common_quantities(first.quantities, second.quantities);
  if (common.empty()) comparison.why_not_compared = "no quantity is common to both";
  for (const CommonQuantity& quantity : common) {
    comparison.parameters.emplace_back().quantity = first.quantities[quantity.in_first];
  }
  const std::uint64_t size =
      (first.campaign->num_runs + second.campaign->num_runs) * sizeof(double);
  const std::size_t num_at_a_time = std::max(kept_size / size, std::size_t{1});
  for (std::size_t begin = 0; begin < common.size(); begin += num_at_a_time) {
    const auto some =
        std::span(common).subspan(begin, std::min(num_at_a_time, common.size() - begin));
    SideErrors of_first(some, &CommonQuantity::in_first);
    SideErrors of_second(some, &CommonQuantity::in_second);
    read_errors(first, second, common, comparison, of_first, of_second);
    comparison.why_not_compared = why_not_compared(first, second, comparison);
    if (!comparison.why_not_compared.empty()) return comparison;
    for (std::size_t i = 0; i < some.size(); ++i) {
      compare_parameter(comparison, of_first, of_second, i, comparison.parameters[begin + i]);
    }
  }
  return comparison;
}

MemberNames lettered(std::size_t count) {
  constexpr std::size_t num_letters = 26;
  MemberNames names{.title = "campaign", .names = {}};
  for (std::size_t i = 0; i < count; ++i) {
    std::string name;
    for (std::size_t rest = i + 1; rest > 0; rest = (rest - 1) / num_letters) {
      name.insert(name.begin(), static_cast<char>('A' + (rest - 1) % num_letters));
    }
    names.names.push_back(name);
  }
  return names;
}

std::size_t place_of(const Quantity& quantity, std::span<const Quantity> among) {
  const auto found = std::ranges::find_if(among, [&](const Quantity& other) {
    return other.name == quantity.name && other.unit == quantity.unit;
  });
  return static_cast<std::size_t>(found - among.begin());
}

std::vector<Quantity> lacking(std::span<const Quantity> first, std::span<const Quantity> second) {
  std::vector<Quantity> own(first.begin(), first.end());
  std::erase_if(
      own, [&](const Quantity& quantity) { return place_of(quantity, second) < second.size(); });
  return own;
}

std::vector<ComparedCampaign> compare_several(std::span<const std::filesystem::path> files,
                                              const HeedStop& heed_stop) {
  PROOFMASS_EXPECT(files.size() >= 2);
  std::vector<ComparedCampaign> members;
  const Store first_store = Store::open_read_only(files.front());
  first_store.read_one_state([&] {
    members.push_back(open_campaign(first_store, files.front(), heed_stop));
    for (const std::filesystem::path& file : files.subspan(1)) {
      const Store store = Store::open_read_only(file);
      store.read_one_state([&] {
        members.push_back(open_campaign(store, file, heed_stop));
        members.back().comparison = compare_campaigns(members.front(), members.back());
        members.back().open_results = nullptr;
      });
    }
  });
  members.front().open_results = nullptr;
  adjust_together(members);
  return members;
}

void adjust_together(std::span<ComparedCampaign> members) {
  std::vector<ParameterComparison*> compared;
  std::vector<ChangePValues> p_values;
  for (ComparedCampaign& member : members) {
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
