#pragma once

struct sqlite3;

namespace proofmass::coordinator {

/// Adds the aggregates and the table draw() of README.md to a connection.
/// @returns SQLite's result code.
[[nodiscard]] int register_functions(sqlite3* connection);

}  // namespace proofmass::coordinator
