#pragma once

struct sqlite3;

namespace proofmass::coordinator {

/// Adds the table draw(campaign) to a connection: one row a run and drawn quantity (see README.md).
/// @returns SQLite's result code.
[[nodiscard]] int register_draw_table(sqlite3* connection);

/// Adds the table definition_entry(campaign): one row a key of the campaign file.
[[nodiscard]] int register_definition_table(sqlite3* connection);

/// Adds all functions and tables of README.md to a connection.
/// @returns SQLite's result code.
[[nodiscard]] int register_functions(sqlite3* connection);

}  // namespace proofmass::coordinator
