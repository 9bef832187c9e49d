#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/run_result.hpp"

namespace proofmass::coordinator::detail {

/// Results as rows of `run_result`; the columns follow from the model's ResultSchema.
class ResultRows {
 public:
  explicit ResultRows(const Database& database);

  /// Stores a result unless the run has one; returns whether it did.
  [[nodiscard]] bool insert(const RunResult& result);

  /// The stored result. @pre There is one.
  [[nodiscard]] RunResult read(RunIndex run);

 private:
  const Database& database_;
  Statement insert_;
  Statement select_;
  std::optional<Statement> select_standard_errors_;  ///< None if the model has none.
};

/// estimate − truth of a quantity in the completed runs below ?1, in run order.
[[nodiscard]] Statement select_errors(const Database& database, std::size_t quantity);

/// Whether two results of one run agree in everything that means something.
[[nodiscard]] bool are_equal(const RunResult& left, const RunResult& right);

/// FNV-1a of everything in a result that means something, zeros without a sign: what people
/// compare.
[[nodiscard]] std::uint64_t digest(const RunResult& result);

/// Checks a delivery before it is stored.
/// @throws StoreError naming the field.
void check_delivery(const Delivery& delivery, std::uint64_t num_runs);

}  // namespace proofmass::coordinator::detail
