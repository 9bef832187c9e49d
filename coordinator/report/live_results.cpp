#include "coordinator/report/live_results.hpp"

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
      figures_(objectives_.size(), 0) {}

void LiveResults::add(const RunResult& result) {
  statistics_.add(result);
  standard_errors_.add(result);
  figures_.add(result);
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
  review.figures = ErrorFigures(figures_).figures();
  StandardErrorStatistics errors = standard_errors_.statistics();
  if (!are_draws_independent_) leave_out_intervals(errors);
  std::string html = "<h3>Accuracy so far</h3>\n" + html_table(accuracy_table(review));
  for (const Table& table : standard_error_tables(schema_, errors)) html += table_or_nothing(table);
  return html + "<h3>Errors so far</h3>\n<figure>\n" +
         svg_of(magnitude_overview(review), SvgUse::embedded) + "</figure>\n";
}

}  // namespace proofmass::coordinator
