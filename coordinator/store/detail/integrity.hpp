#pragma once

#include <string>

#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator::detail {

/// SHA-256 of what defines a campaign, 64 hexadecimal digits: of the row of `campaign`, as text
/// (`NULL` without a value), name, seed, num_runs, definition, model_version, build, created_utc,
/// campaign_uid, owner, stop_rule, num_runs_max and failures_max; then of each table of
/// shared data the number of rows and, by `position`, position and numbers; then the number of rows
/// of `dispersion_value` and, by `quantity` and `run_index`, quantity, run and value. Integers have
/// 64 bits; layout as in Sha256.
[[nodiscard]] std::string compute_table_digest(const Database& database);

/// Stores the digest of all this as it is; to be called after every change of it. @pre Inside a
/// transaction.
void write_table_digest(const Database& database);

/// Checks everything that SQLite can check, and that the schema is that of a new file.
/// @throws StoreError naming the first finding.
void check_integrity(const Database& database);

}  // namespace proofmass::coordinator::detail
