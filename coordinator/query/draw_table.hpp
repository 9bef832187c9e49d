#pragma once

struct sqlite3;

namespace proofmass::coordinator {

/// Adds the table draw(campaign): one row a run and drawn quantity (see README.md).
/// @returns SQLite's result code.
[[nodiscard]] int register_draw_table(sqlite3* connection);

}  // namespace proofmass::coordinator
