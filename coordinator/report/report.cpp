#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <optional>

#include "coordinator/report/digest.hpp"
#include "coordinator/report/summarise.hpp"
#include "core/campaign/model.hpp"
#include "core/campaign/statistics.hpp"
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

std::string report_of_one_state(const Store& store, const Campaign& campaign) {
  const auto [results, check, given_up] = read_checked_results(store, campaign);
  const CampaignStatistics& statistics = results.statistics;
  const std::uint64_t num_given_up = num_runs_in(given_up);
  std::string text = summary_text(store.name(), store.seed(), store.num_runs(), statistics,
                                  results.digests.results, check) +
                     given_up_text(given_up) + stop_text(store);
  for (const std::string& table :
       {accuracy_table(campaign, statistics), interval_table(statistics, num_given_up),
        error_table(statistics, num_given_up),
        budget_table(campaign, statistics, results.totals)}) {
    if (!table.empty()) text += "\n" + table;
  }
  return text;
}

}  // namespace

CheckedResults read_checked_results(const Store& store, const Campaign& campaign) {
  CheckedResults checked;
  store.read_one_state([&] {
    checked.results = read_results(store, campaign);
    const CampaignStatistics& statistics = checked.results.statistics;
    checked.check = check_digest(store, statistics.num_runs, checked.results.digests);
    checked.given_up = store.given_up_runs();
    check_given_up(store, statistics, num_runs_in(checked.given_up));
    check_stop_checks(store, campaign.objectives());
  });
  return checked;
}

std::string report_text(const Store& store, const Campaign& campaign) {
  std::string text;
  store.read_one_state([&] { text = report_of_one_state(store, campaign); });
  return text;
}

std::string summary_text(std::string_view name, std::uint64_t seed, std::uint64_t num_runs,
                         const CampaignStatistics& statistics, std::string_view digest,
                         DigestCheck check) {
  const std::uint64_t num_imperfect = statistics.num_not_converged + statistics.num_not_finite +
                                      statistics.num_no_draw + statistics.num_lost;
  std::string text = fmt::format("Campaign  {}\nSeed      {}\nDigest    {}\n", name, seed, digest);
  if (check == DigestCheck::not_checked) {
    text += fmt::format("          (not checked: no stored one of these {} runs)\n",
                        statistics.num_runs);
  }
  text += fmt::format("Runs      {} finished of {}, {} completed\n", statistics.num_runs, num_runs,
                      statistics.num_runs - num_imperfect);
  if (num_imperfect > 0) {
    text += fmt::format(
        "          {} not converged, {} not finite, {} without draw{}\n",
        statistics.num_not_converged, statistics.num_not_finite, statistics.num_no_draw,
        statistics.num_lost > 0 ? fmt::format(", {} lost", statistics.num_lost) : std::string());
  }
  return text;
}

std::string given_up_text(std::span<const RunRange> given_up) {
  if (given_up.empty()) return "";
  constexpr std::size_t columns_max = 76;  // And an ellipsis.
  std::string line =
      fmt::format("          {} given up, having crashed workers:", num_runs_in(given_up));
  for (const RunRange& range : given_up) {
    const std::string item = range.count == 1
                                 ? fmt::format(" {}", range.first.value)
                                 : fmt::format(" {}..{}", range.first.value, range.end() - 1);
    if (line.size() + item.size() > columns_max) return line + " ...\n";
    line += item;
  }
  return line + "\n";
}

namespace {

// Results never change: as many of them are the same ones.
bool are_current(const Store& store) {
  const std::optional<Summary> summary = store.summary();
  return summary && summary->num_finished == num_runs_in(store.finished_runs()) &&
         summary->num_given_up == num_runs_in(store.given_up_runs());
}

}  // namespace

ReadResults read_results(const Store& store, const Campaign& campaign) {
  StatisticsPasses passes(campaign.objectives());
  std::optional<RunTotalPasses> totals;
  if (std::optional<ErrorBudget> budget = campaign.error_budget()) {
    totals.emplace(*std::move(budget));
  }
  ReadResults results{.statistics = {}, .digests = {}, .totals = {}};
  // Both are asked each time: they may need different numbers of passes.
  const auto is_pass_needed = [&] {
    const bool is_for_statistics = passes.end_pass();
    return (totals && totals->end_pass()) || is_for_statistics;
  };
  store.read_one_state([&] {
    Digest digest;
    store.for_each_result([&](const RunResult& result) {
      require_in_range(result, model().results());
      passes.add(result);
      if (totals) totals->add(result);
      digest.add(result);
    });
    while (is_pass_needed()) {
      store.for_each_result([&](const RunResult& result) {
        passes.add(result);
        if (totals) totals->add(result);
      });
    }
    results.statistics = passes.statistics();
    results.digests = digest.finish();
    if (totals) results.totals = totals->totals();
  });
  return results;
}

void update_statistics(Store& store, const Campaign& campaign) {
  if (are_current(store)) return;
  write_statistics(store, campaign, read_results(store, campaign));
}

void write_statistics(Store& store, const Campaign& campaign, const ReadResults& results) {
  store.write_statistics(results.statistics, campaign.error_budget(), results.digests);
}

std::vector<std::string> statistic_differences(const Store& store, const Campaign& campaign,
                                               const CampaignStatistics& statistics) {
  return store.statistic_differences(statistics, campaign.error_budget());
}

}  // namespace proofmass::coordinator
