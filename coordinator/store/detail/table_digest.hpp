#pragma once

#include <string>

#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator::detail {

/// SHA-256 of the tables that belong to a campaign's definition, 64 hexadecimal digits:
/// the number of rows of `environment_row` and, by `position`, their seven numbers; then the number
/// of rows of `dispersion_value` and, by `name` and `run_index`, name, run and value. Integers have
/// 64 bits; layout as in Sha256.
[[nodiscard]] std::string compute_table_digest(const Database& database);

/// Stores the digest of the tables as they are. @pre Inside a transaction.
void write_table_digest(const Database& database);

}  // namespace proofmass::coordinator::detail
