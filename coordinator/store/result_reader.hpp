#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/campaign/run_result.hpp"
#include "core/runs.hpp"

namespace proofmass::coordinator {

namespace detail {
class Database;
}  // namespace detail

/// Results of a campaign database, one after the other, of one state of the file. The Store that
/// made it outlives it.
class ResultReader {
 public:
  /// Reads all results.
  explicit ResultReader(const detail::Database& database);
  /// Reads those of a range of runs. Where a damaged file has them in another order, some are
  /// missed.
  ResultReader(const detail::Database& database, RunRange runs);
  ~ResultReader();
  ResultReader(ResultReader&&) noexcept;
  ResultReader& operator=(ResultReader&&) noexcept;

  /// The next one; empty after the last. Runs are strictly ascending and below the number of runs
  /// of the campaign, and counts and numbers are what their status says.
  /// @throws StoreError `is damaged: ...` if the file has another one.
  [[nodiscard]] std::optional<RunResult> next();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
