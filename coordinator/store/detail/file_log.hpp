#pragma once

#include <filesystem>

namespace proofmass::coordinator::detail {

/// Where SQLite keeps the write-ahead log of a database file.
[[nodiscard]] std::filesystem::path log_path(const std::filesystem::path& file);

/// Whether a write-ahead log with something in it lies beside the file: one that is longer than its
/// header and begins as such a log does.
[[nodiscard]] bool has_log(const std::filesystem::path& file);

/// Whether SQLite finds nothing wrong with the pages and rows of the file alone. Takes some 1 s for
/// a million runs.
[[nodiscard]] bool is_sound_without_log(const std::filesystem::path& file);

/// For a file that is about to be made.
/// @throws StoreError if it is there, or the log of one that is gone: SQLite would apply that to
///         the new file.
void check_absence(const std::filesystem::path& file);

}  // namespace proofmass::coordinator::detail
