#pragma once

#include <string>
#include <vector>

#include "coordinator/report/error_figures.hpp"
#include "coordinator/report/standard_errors.hpp"
#include "core/campaign/campaign.hpp"
#include "core/campaign/run_result.hpp"
#include "core/campaign/statistics.hpp"

namespace proofmass::coordinator {

/// What the results of a campaign tell while they come: each is seen once, in any order. Memory is
/// 17 kB a quantity, so that a copy costs little.
class LiveResults {
 public:
  /// @param schema  Of the results, which are the campaign's.
  LiveResults(const Campaign& campaign, const ResultSchema& schema);

  /// @param result  Its numbers are in range; the run was not added before.
  void add(const RunResult& result);

  [[nodiscard]] CampaignStatistics statistics() const;

  /// A fragment of HTML for a page with review_style(): the accuracy table, that of standard errors
  /// if there are any, and the histograms of |error| of a review report. Headings are of level 3.
  [[nodiscard]] std::string html() const;

 private:
  ResultSchema schema_;
  std::vector<double> objectives_;
  bool are_draws_independent_;
  RunningStatistics statistics_;
  RunningStandardErrors standard_errors_;
  ErrorFigures figures_;
};

}  // namespace proofmass::coordinator
