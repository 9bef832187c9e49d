#pragma once

#include <cstdint>
#include <map>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// Joins what several campaign databases hold of the runs of one campaign: results with the
/// delivery that was kept, workers, losses, runs that were given up, comparisons. The first part
/// that has a run gives its delivery.
class MergeRows {
 public:
  /// @param whole  A new file of the campaign; outlives this object.
  explicit MergeRows(Database& whole);

  /// @pre Inside a transaction; the part has been checked.
  /// @throws StoreError naming the run, if it has another result in a part before this one, or if
  ///         a result breaks the rules of Store::write().
  [[nodiscard]] MergedPart add(const Database& part);

  /// Writes what follows from the rows, and whether the campaign is finished. Called once, after
  /// the last part.
  void finish();

 private:
  using WorkerKeys = std::map<std::int64_t, std::int64_t>;  ///< In the part → in the whole.

  [[nodiscard]] WorkerKeys add_workers(const Database& part);
  [[nodiscard]] MergedPart add_results(const Database& part, const WorkerKeys& workers);
  void add_losses(const Database& part, const WorkerKeys& workers);
  void add_failures(const Database& part);
  void add_comparisons(const Database& part, const WorkerKeys& workers);

  Database& whole_;
  std::uint64_t num_runs_;
  ResultRows results_;
  LargestErrorRows largest_errors_;
};

}  // namespace proofmass::coordinator::detail
