#pragma once

#include <filesystem>

namespace proofmass::coordinator::detail {

/// Where SQLite keeps the write-ahead log of a database file.
[[nodiscard]] std::filesystem::path log_path(const std::filesystem::path& file);

/// Whether a write-ahead log with something in it lies beside the file: one that is longer than its
/// header and begins as such a log does.
[[nodiscard]] bool has_log(const std::filesystem::path& file);

}  // namespace proofmass::coordinator::detail
