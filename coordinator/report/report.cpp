#include "coordinator/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

std::string report_text(const Review& review, Paint paint) {
  const ReadResults& results = review.results;
  std::string text = fitted(wire::visible_lines(summary_text(review))) +
                     given_up_text(results.given_up, paint) + note_text(review.note) +
                     fitted(wire::visible_lines(warnings_text(review.schema, results.warnings) +
                                                (review.stop ? review.stop->text : "")));
  std::vector<Table> tables = accuracy_tables(review);
  const auto further = std::back_inserter(tables);
  std::ranges::move(standard_error_tables(review.schema, results.standard_errors), further);
  std::ranges::move(group_tables(review), further);
  tables.push_back(budget_table(review));
  for (const Table& table : tables) {
    if (!table.rows.empty()) text += "\n" + terminal_text(table, document_style(paint));
  }
  return text;
}

std::string note_text(const std::string& note) {
  if (note.empty()) return {};
  return fitted("Note      " + wire::visible_text(note));
}

std::string summary_text(const Review& review) {
  const CampaignStatistics& statistics = review.results.statistics;
  std::string text = fmt::format("Campaign  {}\n", review.name);
  if (!review.is_imported) text += fmt::format("Seed      {}\n", review.seed);
  text += fmt::format("Digest    {}\n", review.results.digests.results);
  if (review.results.digest_check == DigestCheck::not_checked) {
    text += fmt::format("          (not checked: no stored one of these {} runs)\n",
                        statistics.num_runs);
  }
  text += fmt::format("Runs      {} finished of {}, {} completed\n", statistics.num_runs,
                      review.num_runs, statistics.num_estimated);
  if (statistics.num_estimated < statistics.num_runs) {
    const MissingEstimates& missing = review.results.missing;
    text += fmt::format(
        "          {} not converged, {} not finite, {} without draw{}\n", missing.num_not_converged,
        missing.num_not_finite, missing.num_no_draw,
        missing.num_lost > 0 ? fmt::format(", {} lost", missing.num_lost) : std::string());
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
