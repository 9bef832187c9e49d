#include "coordinator/report/live_results.hpp"

#include <cmath>
#include <cstddef>
#include <utility>

#include "coordinator/charts/svg.hpp"
#include "coordinator/report/report_tables.hpp"
#include "coordinator/report/review.hpp"
#include "coordinator/report/review_charts.hpp"
#include "coordinator/table/document_table.hpp"
#include "core/campaign/independence.hpp"

namespace proofmass::coordinator {

LiveResults::LiveResults(const Campaign& campaign, const ResultSchema& schema)
    : schema_(schema),
      objectives_(campaign.objectives()),
      are_draws_independent_(why_not_independent(campaign).empty()),
      statistics_(objectives_),
      standard_errors_(schema_),
      magnitudes_(objectives_.size()) {}

void LiveResults::add(const RunResult& result) {
  statistics_.add(result);
  standard_errors_.add(result);
  if (!result.is_completed()) return;
  for (std::size_t i = 0; i < magnitudes_.size(); ++i) {
    magnitudes_[i].add(std::abs(result.error(i)));
  }
}

CampaignStatistics LiveResults::statistics() const {
  CampaignStatistics statistics = statistics_.statistics();
  if (!are_draws_independent_) leave_out_intervals(statistics);
  return statistics;
}

std::string LiveResults::html() const {
  Review review;
  review.schema = schema_;
  review.objectives = objectives_;
  review.results.statistics = statistics();
  for (std::size_t i = 0; i < magnitudes_.size(); ++i) {
    QuantityFigures figures{
        .magnitudes = magnitudes_[i].histogram(), .errors = {}, .worst = {}, .convergence = {}};
    const AccuracyStatistic& accuracy = review.results.statistics.accuracy[i];
    if (review.results.statistics.num_estimated > 0) {
      figures.worst.push_back({.run = accuracy.worst_run, .value = accuracy.worst});
    }
    review.figures.push_back(std::move(figures));
  }
  StandardErrorStatistics errors = standard_errors_.statistics();
  if (!are_draws_independent_) leave_out_intervals(errors);
  std::string html = "<h3>Accuracy so far</h3>\n" + html_table(accuracy_table(review));
  for (const Table& table : standard_error_tables(schema_, errors)) html += table_or_nothing(table);
  return html + "<h3>Errors so far</h3>\n<figure>\n" +
         svg_of(magnitude_overview(review), SvgUse::embedded) + "</figure>\n";
}

}  // namespace proofmass::coordinator
