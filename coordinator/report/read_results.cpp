#include "coordinator/report/read_results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "coordinator/report/summarise.hpp"
#include "core/campaign/independence.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {
namespace {

// A run that is given up is one of those that lack a result, and as many as were counted with the
// statistics.
void check_given_up(const Store& store, const CampaignStatistics& statistics,
                    std::uint64_t num_given_up) {
  const std::optional<Summary> summary = store.summary();
  if (summary && summary->num_finished == statistics.num_runs &&
      num_given_up < summary->num_given_up) {
    store.refuse_as_damaged(fmt::format("{} runs are given up, and its statistics are beside {}",
                                        num_given_up, summary->num_given_up));
  }
}

// Results never change: as many of them are the same ones.
bool are_current(const Store& store) {
  const std::optional<Summary> summary = store.summary();
  return summary && summary->num_finished == num_runs_in(store.finished_runs()) &&
         summary->num_given_up == num_runs_in(store.given_up_runs());
}

/// Lets a class with the same functions be one of several ResultPasses.
template <typename Passes>
class PassesOf final : public ResultPasses {
 public:
  template <typename Argument>
  explicit PassesOf(Argument&& argument) : passes(std::forward<Argument>(argument)) {}

  void add(const RunResult& result) override { passes.add(result); }
  [[nodiscard]] bool end_pass() override { return passes.end_pass(); }

  Passes passes;
};

}  // namespace

void MissingEstimates::add(const RunResult& result) {
  if (result.status == RunStatus::not_converged) ++num_not_converged;
  if (result.status == RunStatus::not_finite) ++num_not_finite;
  if (result.status == RunStatus::no_draw) ++num_no_draw;
  if (result.status == RunStatus::lost) ++num_lost;
}

std::uint64_t MissingEstimates::total() const {
  return num_not_converged + num_not_finite + num_no_draw + num_lost + num_given_up;
}

std::string reasons_text(const MissingEstimates& missing) {
  const std::array<std::pair<std::uint64_t, std::string_view>, 5> reasons{
      {{missing.num_not_converged, "not converged"},
       {missing.num_not_finite, "not finite"},
       {missing.num_no_draw, "without draw"},
       {missing.num_lost, "lost"},
       {missing.num_given_up, "given up"}}};
  std::string text;
  for (const auto& [count, reason] : reasons) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, reason);
  }
  return text;
}

RunTotalPasses::RunTotalPasses(ErrorBudget budget)
    : budget_(std::move(budget)), passes_({.levels = {0.5, 0.95}}) {}

void RunTotalPasses::add(const RunResult& result) {
  if (!result.is_completed()) return;
  const double total = budget_.of_run(result).total;
  passes_.add(total);
  if (!is_first_ && total <= totals_.worst) return;
  is_first_ = false;
  totals_.worst = total;
  totals_.worst_run = result.run;
}

bool RunTotalPasses::end_pass() { return passes_.end_pass(); }

std::optional<RunTotals> RunTotalPasses::totals() const {
  if (passes_.count() == 0) return std::nullopt;
  RunTotals totals = totals_;
  totals.median = passes_.percentile(0.5);
  totals.percentile_95 = passes_.percentile(0.95);
  return totals;
}

namespace {

void add_warnings(const Warner& warner, const RunResult& result, CampaignWarnings& all) {
  if (!warner || !result.is_completed()) return;
  const std::vector<Warning> warnings = warner(result);
  if (!warnings.empty()) ++all.num_runs;
  for (const Warning& warning : warnings) {
    const auto is_same = [&](const WarnedQuantity& other) {
      return other.effect == warning.effect && other.quantity == warning.quantity;
    };
    auto found = std::ranges::find_if(all.quantities, is_same);
    if (found == all.quantities.end()) {
      found = all.quantities.insert(found, {warning.effect, warning.quantity});
    }
    ++found->num_runs;
    if (warning.part > found->largest_part) {
      found->largest_part = warning.part;
      found->run = result.run;
    }
    if (all.first.size() < num_warnings_kept) all.first.push_back({result.run, warning});
  }
}

}  // namespace

std::string warnings_text(const CampaignWarnings& warnings) {
  if (warnings.num_runs == 0) return "";
  std::string text =
      fmt::format("          {} completed with a warning, of shifts up to\n", warnings.num_runs);
  for (const WarnedQuantity& of : warnings.quantities) {
    text += fmt::format("          {:.2g} of the objective of {}, by {} ({} {}, most in run {})\n",
                        of.largest_part, model().results().quantities[of.quantity].symbol,
                        of.effect, of.num_runs, of.num_runs == 1 ? "run" : "runs", of.run.value);
  }
  return text;
}

ReadResults read_results(const Store& store, const Campaign& campaign,
                         std::span<ResultPasses* const> further) {
  PassesOf<StatisticsPasses> statistics(campaign.objectives());
  std::optional<PassesOf<RunTotalPasses>> totals;
  std::vector<ResultPasses*> open{&statistics};
  if (std::optional<ErrorBudget> budget = campaign.error_budget()) {
    open.push_back(&totals.emplace(*std::move(budget)));
  }
  open.insert(open.end(), further.begin(), further.end());
  ReadResults results{.statistics = {}, .digests = {}, .totals = {}, .warnings = {}};
  const Warner warner = campaign.warner();
  store.read_one_state([&] {
    Digest digest;
    store.for_each_result([&](const RunResult& result) {
      require_in_range(result, model().results());
      for (ResultPasses* const passes : open) passes->add(result);
      digest.add(result);
      add_warnings(warner, result, results.warnings);
    });
    // They may need different numbers of passes.
    const auto is_done = [](ResultPasses* passes) { return !passes->end_pass(); };
    while (std::erase_if(open, is_done), !open.empty()) {
      store.for_each_result([&](const RunResult& result) {
        for (ResultPasses* const passes : open) passes->add(result);
      });
    }
    results.statistics = statistics.passes.statistics();
    if (!why_not_independent(campaign).empty()) leave_out_intervals(results.statistics);
    results.digests = digest.finish();
    if (totals) results.totals = totals->passes.totals();
  });
  return results;
}

CheckedResults read_checked_results(const Store& store, const Campaign& campaign,
                                    std::span<ResultPasses* const> further) {
  CheckedResults checked;
  store.read_one_state([&] {
    checked.results = read_results(store, campaign, further);
    const CampaignStatistics& statistics = checked.results.statistics;
    checked.check = check_digest(store, statistics.num_runs, checked.results.digests);
    checked.given_up = store.given_up_runs();
    check_given_up(store, statistics, num_runs_in(checked.given_up));
    check_stop_checks(store, campaign.objectives());
  });
  return checked;
}

void update_statistics(Store& store, const Campaign& campaign) {
  if (are_current(store)) return;
  write_statistics(store, campaign, read_results(store, campaign));
}

void write_statistics(Store& store, const Campaign& campaign, const ReadResults& results) {
  store.write_statistics(results.statistics, campaign.error_budget(), results.digests,
                         results.warnings.first);
}

std::vector<std::string> statistic_differences(const Store& store, const Campaign& campaign,
                                               const ReadResults& results) {
  return store.statistic_differences(results.statistics, campaign.error_budget(),
                                     results.warnings.first);
}

}  // namespace proofmass::coordinator
