#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/schema.hpp"

namespace proofmass::coordinator::detail {

/// SHA-256 of what defines a campaign, 64 hexadecimal digits: of the row of `campaign`, as text
/// (`NULL` without a value), name, seed, num_runs, definition, model_version, build, created_utc,
/// campaign_uid, owner, stop_rule, num_runs_max, failures_max and, if it is not NULL,
/// num_runs_fixed, which files of version 8 did not have, and, if it is not empty,
/// model_description; then of each table of
/// shared data the number of rows and, by `position`, position and numbers; then the number of rows
/// of `dispersion_value` and, by `quantity` and `run_index`, quantity, run and value. Integers have
/// 64 bits; layout as in Sha256.
[[nodiscard]] std::string compute_table_digest(const Database& database, const Model& model);

/// Stores the digest of all this as it is; to be called after every change of it. @pre Inside a
/// transaction.
void write_table_digest(const Database& database, const Model& model);

/// Checks everything that SQLite can check, and that the schema is that of a new file.
/// @throws StoreError naming the first finding.
void check_integrity(const Database& database, const StoredKind& kind);

/// What is compared of a table.
struct ComparedTable {
  std::string_view name;
  std::string_view row_name;       ///< An SQL expression that no two rows share: `parameter`.
  std::string_view columns = "*";  ///< All of them, or `a, b`.
  double tolerance = 0.0;          ///< Relative, of numbers; 0: their bits are equal.
};

/// Rows that are not expected.
enum class FurtherRows : std::uint8_t { refuse, ignore };

/// What tables have other than they would have in a new file, a line each: `statistic lacks gain`,
/// `statistic.mean of gain = 1 (must be 25.5)`.
///
/// @param kind     Of the database.
/// @param write    Writes to a new file in memory what is expected. The same functions as those
/// that write to a campaign database: nothing is said twice of what a table holds.
[[nodiscard]] std::vector<std::string> table_differences(
    const Database& database, const StoredKind& kind, const std::function<void(Database&)>& write,
    std::span<const ComparedTable> tables, FurtherRows further = FurtherRows::refuse);

}  // namespace proofmass::coordinator::detail
