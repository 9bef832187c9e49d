#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/result_columns.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator::detail {

/// Where the columns of the values of a campaign stand in a row of `run_result`, from 0. Standard
/// errors and their fit are read by themselves: where there are none, reading them would cost a
/// tenth of all reading.
struct ResultColumns {
  explicit ResultColumns(const ResultSchema& results);

  const ResultSchema& schema;
  std::vector<ValueColumn> values;
  int num_quantities, num_standard_errors, num_fit;
  std::size_t num_correlations;
  int num_health;
  int truth, estimate, health, loss_cause, loss_session, num_all;
};

/// Whether a column has standard errors or their fit.
[[nodiscard]] inline bool is_of_standard_errors(const ValueColumn& column) {
  return column.kind == ValueKind::standard_error || column.kind == ValueKind::fit;
}

/// Results as rows of `run_result`; the columns follow from the ResultSchema of the campaign.
class ResultRows {
 public:
  /// @param results  Of the campaign; outlives the object.
  ResultRows(const Database& database, const ResultSchema& results);

  /// Stores a result unless the run has one; returns whether it did.
  [[nodiscard]] bool insert(const RunResult& result);

  /// The stored result. @pre There is one.
  [[nodiscard]] RunResult read(RunIndex run);

 private:
  const Database& database_;
  ResultColumns columns_;
  Statement insert_;
  Statement select_;
  std::optional<Statement> select_standard_errors_;  ///< None if the campaign has none.
};

/// estimate − truth of a quantity in the completed runs below ?1, in run order.
[[nodiscard]] Statement select_errors(const Database& database, const Quantity& quantity);

/// Whether two results of one run agree in everything that means something.
[[nodiscard]] bool are_equal(const RunResult& left, const RunResult& right);

/// FNV-1a of everything in a result that means something, zeros without a sign: what people
/// compare.
[[nodiscard]] std::uint64_t digest(const RunResult& result);

/// Checks a delivery before it is stored.
/// @throws StoreError naming the field.
void check_delivery(const Delivery& delivery, const ResultSchema& results, std::uint64_t num_runs);

}  // namespace proofmass::coordinator::detail
