#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "coordinator/report/summarise.hpp"
#include "core/campaign/independence.hpp"
#include "core/model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

/// That of another program is not known.
std::optional<std::uint64_t> seed_of(const Store& store) {
  if (store.model().is_imported()) return std::nullopt;
  return store.seed();
}

std::string report_of_one_state(const Store& store, const Campaign& campaign, Paint paint) {
  const auto [results, check, given_up] = read_checked_results(store, campaign);
  const ResultSchema& schema = store.schema();
  const CampaignStatistics& statistics = results.statistics;
  const std::uint64_t num_given_up = num_runs_in(given_up);
  std::string text =
      wire::visible_lines(summary_text(store.name(), seed_of(store), store.num_runs(), statistics,
                                       results.digests.results, check)) +
      given_up_text(given_up, paint) + note_text(campaign) +
      wire::visible_lines(warnings_text(schema, results.warnings) + stop_text(store));
  std::vector<Table> tables{accuracy_table(schema, campaign.objectives(), statistics),
                            interval_table(schema, statistics, num_given_up),
                            error_table(schema, campaign.objectives(), statistics, num_given_up,
                                        campaign.interpretation(), why_not_independent(campaign)),
                            standard_error_table(schema, results.standard_errors),
                            fit_table(schema, results.standard_errors.fit)};
  std::ranges::move(group_tables(schema, results), std::back_inserter(tables));
  tables.push_back(budget_table(schema, campaign.error_budget(), statistics, results.totals));
  for (const Table& table : tables) {
    if (!table.rows.empty()) text += "\n" + terminal_text(table, {.paint = paint});
  }
  return text;
}

}  // namespace

std::string report_text(const Store& store, const Campaign& campaign, Paint paint) {
  std::string text;
  store.read_one_state([&] { text = report_of_one_state(store, campaign, paint); });
  return text;
}

std::string note_text(const Campaign& campaign) {
  const std::string note = campaign.note();
  if (note.empty()) return {};
  return wire::visible_lines("Note      " + wrapped(note, 10, 10) + "\n");
}

std::string summary_text(std::string_view name, std::optional<std::uint64_t> seed,
                         std::uint64_t num_runs, const CampaignStatistics& statistics,
                         std::string_view digest, DigestCheck check) {
  const std::uint64_t num_imperfect = missing_in(statistics, 0).total();
  std::string text = fmt::format("Campaign  {}\n", name);
  if (seed) text += fmt::format("Seed      {}\n", *seed);
  text += fmt::format("Digest    {}\n", digest);
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

std::string given_up_text(std::span<const RunRange> given_up, Paint paint) {
  if (given_up.empty()) return "";
  constexpr std::size_t columns_max = 76;  // And an ellipsis.
  std::string line = fmt::format("          {} given up, having crashed:", num_runs_in(given_up));
  for (const RunRange& range : given_up) {
    const std::string item = range.count == 1
                                 ? fmt::format(" {}", range.first.value)
                                 : fmt::format(" {}..{}", range.first.value, range.end() - 1);
    if (line.size() + item.size() > columns_max)
      return in_tone(line + " ...", Tone::bad, paint) + "\n";
    line += item;
  }
  return in_tone(line, Tone::bad, paint) + "\n";
}

}  // namespace proofmass::coordinator
