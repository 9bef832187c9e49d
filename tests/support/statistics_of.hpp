#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/campaign/statistics.hpp"

namespace proofmass::test {

/// Statistics of results in run order, as those of a campaign database are computed.
inline CampaignStatistics statistics_of(const std::vector<double>& objectives,
                                        std::span<const RunResult> results) {
  RunningStatistics running(objectives);
  for (const RunResult& result : results) running.add(result);
  CampaignStatistics statistics = running.statistics();
  for (std::size_t i = 0; i < objectives.size() && statistics.num_estimated > 0; ++i) {
    std::vector<double> errors;
    for (const RunResult& result : results) {
      if (result.is_completed()) errors.push_back(result.error(i));
    }
    complete(statistics.accuracy[i], errors);
  }
  return statistics;
}

}  // namespace proofmass::test
