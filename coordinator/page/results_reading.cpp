#include "coordinator/page/results_reading.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "core/campaign/campaign.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

/// A range of runs that has to be looked up costs as much as so many results of one range.
constexpr std::uint64_t results_a_range = 32;

/// The runs from `first` on, below `end`, that are not in the set.
std::vector<RunRange> missing_from(const RunSet& runs, std::uint64_t first, std::uint64_t end) {
  RunSet missing;
  if (first < end) missing.add(RunRange{{first}, end - first});
  missing.remove(runs);
  return missing.ranges();
}

}  // namespace

ResultsReading::ResultsReading(const Store& store)
    : campaign_(store.id()), results_(*stored_campaign(store)) {}

bool ResultsReading::is_of(const Store& store) const { return campaign_ == store.id(); }

void ResultsReading::read_further(const Store& store, std::uint64_t num_results_max) {
  std::uint64_t num_left = num_results_max;
  for (const RunRange& range : missing_from(read_, next_run_, store.num_runs())) {
    ResultReader reader = store.results(range);
    while (const std::optional<RunResult> result = reader.next()) {
      require_in_range(*result, model().results());
      results_.add(*result);
      read_.add(RunRange{result->run, 1});
      next_run_ = result->run.value + 1;
      if (--num_left == 0) return;
    }
    next_run_ = range.end();
    num_left -= std::min(num_left, results_a_range);
    if (num_left == 0) return;
  }
  next_run_ = 0;
}

}  // namespace proofmass::coordinator
