#pragma once

struct sqlite3;

namespace proofmass::coordinator {

/// Adds the tables draw(campaign), one row a run and drawn quantity, and
/// definition_entry(campaign), one row a key of the campaign file (see README.md).
/// @returns SQLite's result code.
[[nodiscard]] int register_tables(sqlite3* connection);

/// Adds all functions and tables of README.md to a connection.
/// @returns SQLite's result code.
[[nodiscard]] int register_functions(sqlite3* connection);

}  // namespace proofmass::coordinator
