#pragma once

struct sqlite3;

namespace proofmass::coordinator {

/// Adds the table definition_entry(campaign): one row a key of the campaign file (see README.md).
/// @returns SQLite's result code.
[[nodiscard]] int register_definition_table(sqlite3* connection);

}  // namespace proofmass::coordinator
