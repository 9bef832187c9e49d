#pragma once

#include "coordinator/store/detail/database.hpp"

namespace proofmass::coordinator::detail {

/// Checks everything that SQLite can check, and that the schema is that of a new file.
/// @throws StoreError naming the first finding.
void check_integrity(const Database& database);

}  // namespace proofmass::coordinator::detail
